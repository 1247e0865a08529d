//! A vehicle that follows a plan through moving air: a point with bounds, no dynamics of attitude.
//!
//! | symbol | name | unit |
//! |---|---|---|
//! | p(s), p'(s) | the plan's curve at its time s, and its velocity | length, length/s |
//! | x, v, w | position, ground velocity, wind | length, length/s |
//! | T_p, T_v | [`POSITION_S`], [`VELOCITY_S`] | s |
//! | V, A | largest airspeed, largest acceleration | length/s, length/s^2 |
//!
//! Each step of [`STEP_S`] the vehicle wants the ground velocity u = p'(s) + (p(s) - x) / T_p. What it can have is
//! w + clamp(u - w, V): it flies through the air no faster than V. Its acceleration is (that - v) / T_v, at most A. The plan's
//! time s runs with the clock, and waits while p(s) is farther away than the vehicle flies in [`REACH_S`]: who lags behind
//! stays on the path instead of cutting its corners. The vehicle has arrived once s has come to the end of the plan and
//! x is no farther from the goal than it flies in [`ACCEPT_S`].
//!
//! Wind is a mean and gusts: each component of the gusts is a first-order process with the deviation and the memory that the
//! scenario gives, exact for any step. It has no vertical part, and is the same everywhere.
//!
//! Limits: made for comparing many flights, not for flying one. `quietpath fly` has an autopilot behind a link.

use quietpath_bridge::file::scenario::Wind;
use quietpath_bridge::setpoint::Curve;

/// Step of the simulation, s.
pub const STEP_S: f64 = 0.2;
/// Time in which an error of position is worked off, s.
pub const POSITION_S: f64 = 4.0;
/// Time in which a velocity is reached, s.
pub const VELOCITY_S: f64 = 1.0;
/// How far ahead the plan may run, s of flight at full speed.
pub const REACH_S: f64 = 6.0;
/// How near the goal counts as there, s of flight at full speed.
pub const ACCEPT_S: f64 = 2.0;

/// What bounds a vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Speed of the plan, length units per s.
    pub speed: f64,
    /// Largest airspeed, length units per s.
    pub airspeed: f64,
    /// Largest acceleration, length units per s^2.
    pub accel: f64,
}

/// The air as one vehicle feels it.
#[derive(Clone, Debug)]
pub struct Air {
    mean: [f64; 2],
    gusts: [f64; 2],
    keep: f64,
    fresh: f64,
    random: fastrand::Rng,
}

impl Air {
    /// Air whose mean is drawn about the scenario's.
    pub fn draw(wind: &Wind, random: &mut fastrand::Rng) -> Self {
        let keep = (-STEP_S / wind.gust_time).exp();
        let mean = wind.mean.map(|mean| mean + wind.deviation * normal(random));
        let gusts = [0.0; 2].map(|_: f64| wind.gust * normal(random));
        let fresh = wind.gust * (1.0 - keep * keep).sqrt();
        Self { mean, gusts, keep, fresh, random: random.fork() }
    }

    /// The mean wind, length units per s.
    #[must_use]
    pub const fn mean(&self) -> [f64; 2] {
        self.mean
    }

    fn step(&mut self) -> [f64; 2] {
        for gust in &mut self.gusts {
            *gust = self.keep * *gust + self.fresh * normal(&mut self.random);
        }
        [self.mean[0] + self.gusts[0], self.mean[1] + self.gusts[1]]
    }
}

/// A number from the normal distribution with mean 0 and deviation 1 (Box and Muller).
pub fn normal(random: &mut fastrand::Rng) -> f64 {
    // 1 - u lies in (0, 1], whose logarithm is finite.
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.f64()).cos()
}

/// The way of one vehicle.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// Positions at the instants asked for, length units; at the goal once it has arrived.
    pub positions: Vec<Vec<f64>>,
    /// When it arrived, s; `None` where it did not in time.
    pub arrival: Option<f64>,
    /// Largest distance from where the plan was when the vehicle was there, length units.
    pub off: f64,
}

/// Flies a curve from its first node; `instants` (s, ascending) are those at which positions are kept, and the last of
/// them ends the flight.
#[must_use]
pub fn follow(curve: &Curve, limits: Limits, air: &mut Air, instants: &[f64]) -> Way {
    let mut x = curve.sample(curve.begin()).position;
    let mut v = curve.sample(curve.begin()).velocity;
    let goal = curve.sample(curve.end()).position;
    let (mut clock, mut s) = (curve.begin(), curve.begin());
    let mut way = Way { positions: Vec::with_capacity(instants.len()), arrival: None, off: 0.0 };
    for instant in instants {
        while clock < *instant && way.arrival.is_none() {
            let step = STEP_S.min(*instant - clock);
            let aim = curve.sample(s);
            let error: Vec<f64> = aim.position.iter().zip(&x).map(|(p, x)| p - x).collect();
            let distance = norm(&error);
            way.off = way.off.max(distance);
            let wanted: Vec<f64> = aim.velocity.iter().zip(&error).map(|(p, e)| p + e / POSITION_S).collect();
            advance(&mut x, &mut v, &wanted, limits, air.step(), step);
            clock += step;
            if distance <= limits.speed * REACH_S {
                s += step;
            }
            let near = x.iter().zip(&goal).map(|(x, goal)| (x - goal) * (x - goal)).sum::<f64>().sqrt();
            if s >= curve.end() && near <= limits.speed * ACCEPT_S {
                way.arrival = Some(clock);
            }
        }
        way.positions.push(if way.arrival.is_some() { goal.clone() } else { x.clone() });
    }
    way
}

/// One step of the vehicle.
fn advance(x: &mut [f64], v: &mut [f64], wanted: &[f64], limits: Limits, wind: [f64; 2], step: f64) {
    let wind = |axis: usize| wind.get(axis).copied().unwrap_or(0.0);
    let through: Vec<f64> = wanted.iter().enumerate().map(|(axis, u)| u - wind(axis)).collect();
    let slower = (limits.airspeed / norm(&through).max(f64::MIN_POSITIVE)).min(1.0);
    let had = v.iter().enumerate();
    let pull: Vec<f64> = had.zip(&through).map(|((axis, v), u)| (wind(axis) + slower * u - v) / VELOCITY_S).collect();
    let weaker = (limits.accel / norm(&pull).max(f64::MIN_POSITIVE)).min(1.0);
    for ((x, v), pull) in x.iter_mut().zip(v).zip(pull) {
        *v += weaker * pull * step;
        *x += *v * step;
    }
}

fn norm(vector: &[f64]) -> f64 {
    vector.iter().map(|part| part * part).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use quietpath_bridge::file::PlanFile;
    use quietpath_bridge::file::plan::AgentPlan;

    const LIMITS: Limits = Limits { speed: 1.0, airspeed: 1.25, accel: 0.5 };
    const CALM: Wind = Wind { mean: [0.0; 2], deviation: 0.0, gust: 0.0, gust_time: 10.0 };

    /// 100 s along x at the largest speed.
    fn straight() -> Curve {
        let path = (0..=10).map(|node| vec![10.0 * f64::from(node), 0.0]).collect();
        let agents = vec![AgentPlan { name: "a".into(), path, ..AgentPlan::default() }];
        Curve::of(&PlanFile { duration: 100.0, agents, ..PlanFile::default() }, "a").unwrap()
    }

    fn fly(wind: &Wind) -> Way {
        let instants: Vec<f64> = (0..=40).map(|second| 5.0 * f64::from(second)).collect();
        follow(&straight(), LIMITS, &mut Air::draw(wind, &mut fastrand::Rng::with_seed(3)), &instants)
    }

    #[test]
    fn in_still_air_the_plan_is_flown_on_time() {
        let way = fly(&CALM);
        assert!((way.arrival.unwrap() - 100.0).abs() < 3.0, "{:?}", way.arrival);
        assert!(way.off < 0.3, "{}", way.off);
        assert!((way.positions[10][0] - 50.0).abs() < 0.3, "{:?}", way.positions[10]);
    }

    #[test]
    fn a_headwind_delays_as_much_as_airspeed_says() {
        // 1.25 through the air against 0.75 leaves 0.5 over the ground.
        let way = fly(&Wind { mean: [-0.75, 0.0], ..CALM });
        assert!((way.arrival.unwrap() - 196.0).abs() < 6.0, "{:?}", way.arrival);
        assert_eq!(fly(&Wind { mean: [-1.3, 0.0], ..CALM }).arrival, None);
    }

    #[test]
    fn a_crosswind_that_can_be_held_leaves_a_steady_offset_below_reach() {
        let way = fly(&Wind { mean: [0.0, 0.6], ..CALM });
        assert!(way.arrival.is_some() && way.off < LIMITS.speed * REACH_S, "{way:?}");
        // In the air the plan's velocity is held exactly, so the offset dies out.
        assert!(way.positions[18][1].abs() < 0.05, "{:?}", way.positions[18]);
    }

    #[test]
    fn gusts_have_the_deviation_and_the_memory_that_was_asked_for() {
        let wind = Wind { gust: 2.0, gust_time: 4.0, ..CALM };
        let mut air = Air::draw(&wind, &mut fastrand::Rng::with_seed(7));
        let values: Vec<f64> = (0..200_000).map(|_| air.step()[0]).collect();
        let mean_of = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let squares: Vec<f64> = values.iter().map(|value| value * value).collect();
        // One memory apart, the correlation is 1/e.
        let lag = (wind.gust_time / STEP_S) as usize;
        let products: Vec<f64> = values.iter().zip(values.iter().skip(lag)).map(|(a, b)| a * b).collect();
        assert!((mean_of(&squares).sqrt() - 2.0).abs() < 0.1, "{}", mean_of(&squares).sqrt());
        let memory = mean_of(&products) / mean_of(&squares);
        assert!((memory - (-1.0_f64).exp()).abs() < 0.05, "{memory}");
    }
}
