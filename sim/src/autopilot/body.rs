//! The body: a point mass with bounds on speed, climb and acceleration.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | x, v | position and velocity: east, north, up of home | m, m/s |
//! | a | acceleration, of at most `accel_max` | m/s^2 |
//!
//! The control law is the one that position controllers of multicopters have: a velocity from the error of the position,
//! an acceleration from the error of the velocity, each on top of what the setpoint says.
//!
//! Limits: no attitude, no wind, no battery. The ground is flat, at the height of home.

/// East, north, up.
pub type Vector = [f64; 3];

/// Velocity for a metre of error, 1/s.
const POSITION_GAIN: f64 = 1.0;
/// Acceleration for a metre per second of error, 1/s.
const VELOCITY_GAIN: f64 = 4.0;
/// Share of the acceleration that is planned with for stopping: the rest is for errors.
const STOP_SHARE: f64 = 0.5;

/// What the vehicle is capable of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Largest horizontal speed, m/s.
    pub speed_max: f64,
    /// Largest vertical speed, m/s.
    pub climb_max: f64,
    /// Largest acceleration, m/s^2.
    pub accel_max: f64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { speed_max: 15.0, climb_max: 4.0, accel_max: 5.0 }
    }
}

/// What the body is steered by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// Go to a position and stay there.
    Rest(Vector),
    /// Be at a position with a velocity and an acceleration.
    Along {
        /// Position, m.
        position: Vector,
        /// Velocity, m/s.
        velocity: Vector,
        /// Acceleration, m/s^2.
        acceleration: Vector,
    },
    /// Have a velocity, m/s.
    Velocity(Vector),
    /// Follow the straight line between two positions.
    Leg {
        /// Where it begins, m.
        from: Vector,
        /// Where it ends, m.
        to: Vector,
        /// Speed along it, m/s.
        speed: f64,
        /// Whether to stop at its end.
        stops: Stops,
    },
    /// Nobody steers: it glides on.
    Nothing,
}

/// Whether a leg ends at rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stops {
    /// It does.
    Yes,
    /// The next leg goes on.
    No,
}

/// Where the body is and how it moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Body {
    /// Position, m.
    pub position: Vector,
    /// Velocity, m/s.
    pub velocity: Vector,
}

pub(super) fn add(a: Vector, b: Vector) -> Vector {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn subtract(a: Vector, b: Vector) -> Vector {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn scale(a: Vector, by: f64) -> Vector {
    a.map(|part| part * by)
}

pub(super) fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn norm(a: Vector) -> f64 {
    dot(a, a).sqrt()
}

fn shortened(a: Vector, longest: f64) -> Vector {
    let length = norm(a);
    if length > longest { scale(a, longest / length) } else { a }
}

impl Limits {
    fn keep(&self, velocity: Vector) -> Vector {
        let [east, north, _] = shortened([velocity[0], velocity[1], 0.0], self.speed_max);
        [east, north, velocity[2].clamp(-self.climb_max, self.climb_max)]
    }

    /// The speed from which the vehicle can still stop within a distance, m/s.
    fn stopping(&self, distance: f64) -> f64 {
        (2.0 * STOP_SHARE * self.accel_max * distance).sqrt().min(POSITION_GAIN * distance)
    }
}

impl Body {
    /// Lets `seconds` pass.
    pub fn step(&mut self, seconds: f64, aim: &Aim, limits: &Limits) {
        let (wanted, ahead) = match *aim {
            Aim::Nothing => (self.velocity, [0.0; 3]),
            Aim::Velocity(velocity) => (velocity, [0.0; 3]),
            Aim::Rest(position) => {
                let error = subtract(position, self.position);
                let distance = norm(error);
                let speed = if distance > 0.0 { limits.stopping(distance) / distance } else { 0.0 };
                (scale(error, speed), [0.0; 3])
            }
            Aim::Along { position, velocity, acceleration } => {
                let error = subtract(position, self.position);
                let distance = norm(error);
                let catch_up = if distance > 0.0 { limits.stopping(distance) / distance } else { 0.0 };
                (add(velocity, scale(error, catch_up)), acceleration)
            }
            Aim::Leg { from, to, speed, stops } => (self.along_leg(from, to, speed, stops, limits), [0.0; 3]),
        };
        let error = subtract(limits.keep(wanted), self.velocity);
        let acceleration = shortened(add(ahead, scale(error, VELOCITY_GAIN)), limits.accel_max);
        let before = self.velocity;
        self.velocity = limits.keep(add(before, scale(acceleration, seconds)));
        self.position = add(self.position, scale(add(before, self.velocity), 0.5 * seconds));
        if self.position[2] < 0.0 {
            self.position[2] = 0.0;
            self.velocity[2] = self.velocity[2].max(0.0);
        }
    }

    /// The velocity along a leg, with what is needed to get back onto it.
    fn along_leg(&self, from: Vector, to: Vector, speed: f64, stops: Stops, limits: &Limits) -> Vector {
        let speed = speed.min(limits.speed_max.hypot(limits.climb_max));
        let rest = subtract(to, self.position);
        let line = subtract(to, from);
        let length = norm(line);
        // A leg without length is a place to be at.
        let direction =
            if length > 1e-6 { scale(line, 1.0 / length) } else { scale(rest, 1.0 / norm(rest).max(1e-6)) };
        let along = dot(rest, direction);
        let aside = subtract(rest, scale(direction, along));
        let along = match stops {
            Stops::Yes => speed.min(limits.stopping(along.abs())) * along.signum(),
            Stops::No => speed,
        };
        shortened(add(scale(direction, along), scale(aside, POSITION_GAIN)), speed.max(0.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { speed_max: 8.0, climb_max: 2.0, accel_max: 3.0 };
    const STEP: f64 = 0.02;

    /// Flies for a time; the largest speed and acceleration on the way.
    fn fly(body: &mut Body, seconds: f64, mut aim: impl FnMut(f64) -> Aim) -> (f64, f64) {
        let (mut speed, mut acceleration) = (0.0_f64, 0.0_f64);
        for step in 0..(seconds / STEP) as usize {
            let before = body.velocity;
            body.step(STEP, &aim(step as f64 * STEP), &LIMITS);
            speed = speed.max(body.velocity[0].hypot(body.velocity[1]));
            acceleration = acceleration.max(norm(subtract(body.velocity, before)) / STEP);
        }
        (speed, acceleration)
    }

    #[test]
    fn it_comes_to_rest_where_it_is_sent_within_its_limits() {
        let mut body = Body::default();
        let to = [100.0, -40.0, 20.0];
        let (speed, acceleration) = fly(&mut body, 60.0, |_| Aim::Rest(to));
        assert!(norm(subtract(body.position, to)) < 0.05 && norm(body.velocity) < 0.05, "{body:?}");
        assert!(speed <= 8.0 + 1e-9 && speed > 7.0 && acceleration <= 3.0 + 1e-9, "{speed} {acceleration}");
    }

    #[test]
    fn it_follows_a_circle_that_it_is_told_with_its_derivatives() {
        let (radius, rate) = (30.0, 0.2);
        let circle = |time: f64| {
            let (sin, cos) = (rate * time).sin_cos();
            let speed = radius * rate;
            Aim::Along {
                position: [radius * cos, radius * sin, 10.0],
                velocity: [-speed * sin, speed * cos, 0.0],
                acceleration: [-speed * rate * cos, -speed * rate * sin, 0.0],
            }
        };
        let mut body = Body { position: [radius, 0.0, 10.0], velocity: [0.0; 3] };
        fly(&mut body, 20.0, circle);
        let Aim::Along { position, .. } = circle(20.0) else { panic!("a circle") };
        assert!(norm(subtract(body.position, position)) < 0.2, "{body:?} {position:?}");
    }

    #[test]
    fn legs_are_followed_and_end_at_rest_where_they_should() {
        let mut body = Body { position: [0.0, 3.0, 10.0], velocity: [0.0; 3] };
        let leg = |stops| Aim::Leg { from: [0.0, 0.0, 10.0], to: [80.0, 0.0, 10.0], speed: 5.0, stops };
        fly(&mut body, 8.0, |_| leg(Stops::No));
        assert!(body.position[1].abs() < 0.1 && (body.velocity[0] - 5.0).abs() < 0.05, "{body:?}");
        fly(&mut body, 30.0, |_| leg(Stops::Yes));
        assert!((body.position[0] - 80.0).abs() < 0.1 && norm(body.velocity) < 0.1, "{body:?}");
    }

    #[test]
    fn the_ground_is_not_passed() {
        let mut body = Body { position: [0.0, 0.0, 3.0], velocity: [0.0; 3] };
        fly(&mut body, 10.0, |_| Aim::Velocity([0.0, 0.0, -1.0]));
        assert_eq!((body.position[2], body.velocity[2]), (0.0, 0.0));
    }
}
