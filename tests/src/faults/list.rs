//! What goes wrong in one process.

use std::time::Duration;

use fastrand::Rng;
use quietpath_bridge::clock::Time;
use quietpath_bridge::flight::Flight;
use quietpath_bridge::link::memory::Faults;
use quietpath_bridge::replan::Observation;
use quietpath_bridge::telemetry::Mode;
use quietpath_sim::autopilot::trouble::{Trouble, stay};
use quietpath_sim::rehearsal::{Rehearsal, Setup};

use super::Outcome::{self, Arrives, Holds, LetsGo, Refuses};
use super::air::{After, Around, Trial, When};
use super::{Fault, Fly};

/// A time between two, s.
fn seconds(random: &mut Rng, from: f64, until: f64) -> Duration {
    Duration::from_secs_f64(from + (until - from) * random.f64())
}

fn millis(millis: u64) -> Duration {
    Duration::from_millis(millis)
}

/// A window from now on.
fn window(flight: &Rehearsal, span: Duration) -> (Time, Time) {
    (flight.now(), flight.now() + span)
}

fn silence(flight: &mut Rehearsal, span: Duration) {
    let (from, until) = window(flight, span);
    flight.machine_mut().befall(Trouble::Silence { from, until });
}

/// The position leaps by up to a kilometre, for a while.
fn leap(flight: &mut Rehearsal, around: &mut Around) {
    let random = &mut around.random;
    let (from, until) = window(flight, seconds(random, 0.5, 4.0));
    let by = [0, 1].map(|_| 2000.0 * random.f64() - 1000.0);
    flight.machine_mut().befall(Trouble::Leap { from, until, by });
}

fn nonsense(flight: &mut Rehearsal, around: &mut Around) {
    let (from, until) = window(flight, seconds(&mut around.random, 0.5, 8.0));
    flight.machine_mut().befall(Trouble::Nonsense { from, until });
}

/// 10 000 observations a second: of the sensors where they are, of ones that nobody knows, of nothing.
fn flood(flight: &mut Rehearsal, around: &mut Around) {
    let sensors = flight.flight().world().sensors.clone();
    for number in 0..200 {
        let line = match number % 4 {
            0 => format!("{{\"id\": \"ghost-{}\", \"position\": [4.0, 18.0]}}", around.random.u8(..3)),
            1 => "{\"id\": \"s1\", \"position\": [1e999, 2.0]}".to_owned(),
            2 => "{\"id\": \"s1\", \"position\": [-1e300, 1e300], \"covariance\": [[1, 0], [0, 1]]}".to_owned(),
            _ => format!("{{\"id\": \"{}\"}}", sensors[around.random.usize(..sensors.len())].name),
        };
        if let Ok(seen) = Observation::parse(&line) {
            flight.observe(seen);
        }
    }
}

fn station(flight: &mut Rehearsal, _: &mut Around) {
    let home = flight.machine().settings().home;
    let (at, items) = (flight.now(), vec![stay(&home, 60.0); 2]);
    flight.machine_mut().befall(Trouble::Station { at, items });
}

/// A second bridge with the same scenario and plan begins its flight.
fn join(flight: &mut Rehearsal, around: &mut Around) {
    let second = Flight::new(&around.scenario, &around.plan, around.settings.clone());
    flight.machine_mut().join(second.unwrap_or_else(|error| panic!("{error}")));
}

fn wires(setup: &mut Setup, faults: Faults) {
    setup.faults = faults;
}

fn air(name: &'static str, says: &'static str, [steered, mission]: [Option<Outcome>; 2], trial: Trial) -> Fault {
    Fault { name, says, steered, mission, fly: Fly::Air(trial) }
}

const fn both(outcome: Outcome) -> [Option<Outcome>; 2] {
    [Some(outcome), Some(outcome)]
}

/// All of them.
#[must_use]
pub fn faults() -> Vec<Fault> {
    on_the_wire().into_iter().chain(of_the_vehicle()).chain(of_the_bridge()).chain(by_others()).collect()
}

fn on_the_wire() -> Vec<Fault> {
    const CLEAN: Faults = Faults::NONE;
    let trial = |prepare| Trial { prepare, ..Trial::NONE };
    vec![
        air("none", "nothing", both(Arrives), Trial::NONE),
        air(
            "loss",
            "up to 15 % of the frames are lost, in each direction",
            both(Arrives),
            trial(|setup, random| wires(setup, Faults { loss: 0.15 * random.f64(), ..CLEAN })),
        ),
        air(
            "delay",
            "frames come up to half a second late",
            both(Arrives),
            trial(|setup, random| wires(setup, Faults { delay: seconds(random, 0.05, 0.5), ..CLEAN })),
        ),
        air(
            "duplication",
            "every other frame comes twice",
            both(Arrives),
            trial(|setup, _| wires(setup, Faults { duplication: 0.5, jitter: millis(50), ..CLEAN })),
        ),
        air(
            "reordering",
            "frames overtake each other, by up to 0.3 s",
            both(Arrives),
            trial(|setup, random| wires(setup, Faults { jitter: seconds(random, 0.05, 0.3), ..CLEAN })),
        ),
        air(
            "corruption",
            "up to 15 % of the frames have a flipped bit",
            both(Arrives),
            trial(|setup, random| wires(setup, Faults { corruption: 0.15 * random.f64(), ..CLEAN })),
        ),
        air(
            "all-of-these",
            "5 % lost, 10 % twice, 5 % with a flipped bit, 50 to 200 ms late and out of order",
            both(Arrives),
            trial(|setup, _| {
                let (delay, jitter) = (millis(50), millis(150));
                wires(setup, Faults { loss: 0.05, duplication: 0.1, corruption: 0.05, delay, jitter });
            }),
        ),
        air(
            "short-silence",
            "the link carries nothing for up to 0.9 s",
            both(Arrives),
            Trial {
                strike: |flight, around| silence(flight, seconds(&mut around.random, 0.2, 0.9)),
                hurry_s: 4.0,
                ..Trial::NONE
            },
        ),
        air(
            "silence",
            "the link carries nothing for 4 to 10 s",
            [Some(Holds), Some(Arrives)],
            Trial { strike: |flight, around| silence(flight, seconds(&mut around.random, 4.0, 10.0)), ..Trial::NONE },
        ),
    ]
}

fn of_the_vehicle() -> Vec<Fault> {
    vec![
        air(
            "autopilot-restart",
            "the autopilot begins anew in flight",
            both(Arrives),
            // One that could be faster than its plans hurries after them.
            Trial {
                prepare: |setup, _| setup.autopilot.limits.speed_max *= 0.525,
                strike: |flight, _| flight.machine_mut().restart(),
                ..Trial::NONE
            },
        ),
        air(
            "leap",
            "the position that the vehicle says leaps by up to 1.4 km, for up to 4 s",
            both(Arrives),
            Trial { strike: leap, ..Trial::NONE },
        ),
        air(
            "nonsense",
            "positions are no places and numbers are NaN, for up to 8 s",
            both(Arrives),
            Trial { strike: nonsense, ..Trial::NONE },
        ),
        air(
            "nonsense-and-stop",
            "the same, and the bridge is ended meanwhile",
            [Some(Holds), None],
            Trial {
                strike: |flight, around| {
                    nonsense(flight, around);
                    for _ in 0..20 {
                        let _ = flight.step();
                    }
                    flight.stop("enough");
                },
                after: After::Silent,
                ..Trial::NONE
            },
        ),
        air(
            "disarm",
            "the vehicle is disarmed",
            both(LetsGo),
            Trial { strike: |flight, _| flight.machine_mut().disarm(), after: After::Silent, ..Trial::NONE },
        ),
    ]
}

fn of_the_bridge() -> Vec<Fault> {
    vec![
        air(
            "clock",
            "the bridge's clock leaps ahead by an hour",
            [Some(Holds), Some(Arrives)],
            Trial { strike: |flight, _| flight.leap(Duration::from_secs(3600)), ..Trial::NONE },
        ),
        air(
            "sleep",
            "the bridge's clock leaps ahead by 4 to 20 s",
            [Some(Holds), Some(Arrives)],
            Trial { strike: |flight, around| flight.leap(seconds(&mut around.random, 4.0, 20.0)), ..Trial::NONE },
        ),
        air(
            "slow-plan",
            "one plan takes 6 s, where it may take 1",
            both(Arrives),
            Trial {
                prepare: |setup, _| setup.planning = Duration::from_secs(6),
                strike: |flight, _| flight.plan_in(millis(500)),
                ..Trial::NONE
            },
        ),
        air(
            "slow-planner",
            "every plan takes 6 s, where it may take 1",
            both(Holds),
            Trial { prepare: |setup, _| setup.planning = Duration::from_secs(6), ..Trial::NONE },
        ),
        air(
            "stalled-planner",
            "the planner never answers",
            both(Holds),
            Trial { prepare: |setup, _| setup.planning = Duration::from_secs(86_400), ..Trial::NONE },
        ),
        air(
            "flood",
            "10 000 observations a second for 5 s, most of them nonsense",
            both(Arrives),
            Trial { strike: flood, span_s: 5.0, ..Trial::NONE },
        ),
        air(
            "stop",
            "somebody ends the bridge",
            [Some(Holds), None],
            Trial { strike: |flight, _| flight.stop("enough"), after: After::Silent, ..Trial::NONE },
        ),
    ]
}

fn by_others() -> Vec<Fault> {
    vec![
        air(
            "crowd",
            "254 other systems speak on the link: autopilots and ground stations",
            both(Arrives),
            Trial {
                prepare: |setup, _| {
                    setup.flight.system = Some(setup.autopilot.system);
                    setup.autopilot.troubles.push(Trouble::Crowd { from: Time::ZERO });
                },
                ..Trial::NONE
            },
        ),
        air(
            "takeover",
            "a person changes the mode",
            both(LetsGo),
            Trial {
                strike: |flight, _| {
                    flight.machine_mut().change_mode(Mode::Return);
                },
                after: After::Silent,
                ..Trial::NONE
            },
        ),
        air(
            "station",
            "another ground station replaces the mission",
            [Some(Arrives), Some(LetsGo)],
            // Without plans of our own on their way: of two uploads at once the autopilot takes one.
            Trial { prepare: |setup, _| setup.flight.replan = None, strike: station, ..Trial::NONE },
        ),
        air(
            "second-planner",
            "a second bridge begins on the same vehicle while the first flies",
            both(Arrives),
            Trial { strike: join, ..Trial::NONE },
        ),
        air(
            "two-planners",
            "a second bridge begins on the same vehicle before either flies",
            both(Refuses),
            Trial { strike: join, when: When::Before, ..Trial::NONE },
        ),
    ]
}
