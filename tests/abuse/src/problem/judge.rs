//! What must be true of every plan.

use quietpath_core::constraints::violations;
use quietpath_core::horizon::{Horizon, Search, State};
use quietpath_core::math::norm;
use quietpath_core::metrics::Sample;
use quietpath_core::objective::{Extreme, value};
use quietpath_core::scenario::View;
use quietpath_core::solver::{Outcome, Settings, Start, Status, Workspace, plan};
use quietpath_core::{Real, Trajectory};

use super::Problem;
use super::draw::{AGENTS, NODES, SENSORS};
use crate::dice::Dice;

/// Questions after which the deadline is over, one plan each.
const CUTS: [usize; 4] = [0, 1, 5, 25];
/// Starts that the planner may try, each with all iterations of its settings: ten times what it tries today.
const STARTS_MAX: usize = 300;
/// Steps of a flight that is rolled.
const STEPS: usize = 4;

type Memory<T, const DIM: usize> = Workspace<T, DIM, NODES, SENSORS, AGENTS>;
type Path<T, const DIM: usize> = Trajectory<T, DIM, NODES, AGENTS>;

/// A promise that was broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broken(pub String);

/// What came of a problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// It is no problem, or its start velocity cannot be followed, and the core says so.
    Refused,
    /// It was planned.
    Planned {
        /// How planning ended.
        status: Status,
        /// Whether a straight line keeps all constraints.
        is_straight: bool,
    },
}

/// Plans a problem with more and more time, and looks at each plan.
///
/// # Errors
/// The promise that was broken.
pub fn judge<T: Real, const DIM: usize>(
    problem: &Problem<T, DIM>,
    settings: &Settings<T>,
) -> Result<Verdict, Broken> {
    let stored = match problem.stored() {
        Ok(stored) => stored,
        Err(error) if error.to_string().is_empty() => return Err(Broken("an error without words".into())),
        Err(_) => return Ok(Verdict::Refused),
    };
    let view = stored.view();
    let is_straight = has_straight(&view);
    let mut memory: Box<Memory<T, DIM>> = Box::new(Workspace::new());
    let mut before: Option<T> = None;
    let mut status = None;
    for cut in CUTS.iter().copied().map(Some).chain([None]) {
        let mut asked = 0;
        let mut deadline = || {
            asked += 1;
            cut.is_some_and(|cut| asked > cut)
        };
        let Ok(outcome) = plan(&view, settings, Start::Global, &mut memory, &mut deadline) else {
            return Ok(Verdict::Refused);
        };
        let fail = |what: &str| Err(Broken(format!("{what} (cut {cut:?}, {outcome:?})")));
        if let Some(what) = wrong(&view, settings, &outcome, memory.best()) {
            return fail(what);
        }
        if outcome.status == Status::Deadline && cut.is_none_or(|cut| asked <= cut) {
            return fail("stopped at a deadline that was not over");
        }
        if matches!(outcome.status, Status::Infeasible | Status::NonFinite) && is_straight {
            return fail("found no plan, and a straight line is one");
        }
        if matches!(outcome.status, Status::Infeasible | Status::NonFinite) {
            continue;
        }
        if let Some(earlier) = before.filter(|earlier| outcome.objective > *earlier) {
            return fail(&format!("got worse with more time: {earlier:?} before"));
        }
        (before, status) = (Some(outcome.objective), Some(outcome.status));
    }
    // The workspace has seen all of it: nothing of that may show.
    let mut fresh: Box<Memory<T, DIM>> = Box::new(Workspace::new());
    let again = plan(&view, settings, Start::Global, &mut fresh, &mut || false);
    let last = plan(&view, settings, Start::Global, &mut memory, &mut || false);
    let is_same = format!("{again:?}") == format!("{last:?}");
    if !is_same || fresh.best().active() != memory.best().active() && status.is_some() {
        return Err(Broken(format!("a used workspace plans differently: {again:?} and {last:?}")));
    }
    let ended = again.map_or(Status::Infeasible, |outcome| outcome.status);
    Ok(Verdict::Planned { status: ended, is_straight })
}

/// What is wrong with an outcome.
fn wrong<T: Real, const DIM: usize>(
    view: &View<'_, T, DIM>,
    settings: &Settings<T>,
    outcome: &Outcome<T, DIM>,
    best: &Path<T, DIM>,
) -> Option<&'static str> {
    let mut scratch: [Sample<T, DIM>; SENSORS] = core::array::from_fn(|_| Sample::default());
    let is_feasible = violations(view, best, &mut scratch).feasible();
    let steps_max = STARTS_MAX * (settings.iterations + settings.refinements + 1);
    if outcome.iterations + outcome.refinements > steps_max {
        return Some("worked without end");
    }
    match outcome.status {
        Status::Infeasible if outcome.obstacle.is_none() => Some("is infeasible and does not say why"),
        Status::Infeasible if is_feasible => Some("says that a feasible plan is none"),
        Status::Infeasible => None,
        // The core plans what it is given; numbers that overflow in it are its caller's.
        Status::NonFinite => None,
        _ if outcome.obstacle.is_some() => Some("has a plan and an obstacle"),
        _ if !is_feasible => Some("calls an infeasible plan a plan"),
        _ if !is_finite(best) => Some("has numbers in its plan that are not finite"),
        _ => {
            let worth = value(view, best, Extreme::Exact, &mut scratch);
            let close = T::real(1e-9).max(T::EPSILON * T::real(64.0));
            let is_claimed = (worth - outcome.objective).abs() <= close * (T::one() + worth.abs());
            (!is_claimed).then_some("claims another objective than its plan has")
        }
    }
}

/// Whether a straight line, in all the time there is or a little more than the shortest, keeps all constraints and has an
/// objective.
fn has_straight<T: Real, const DIM: usize>(view: &View<'_, T, DIM>) -> bool {
    let mut scratch: [Sample<T, DIM>; SENSORS] = core::array::from_fn(|_| Sample::default());
    let allowed = view.frame.time.max - view.frame.start_time;
    let times = view.agents.iter().map(|agent| norm(&(agent.goal - agent.start)) / agent.speed_max);
    let shortest = times.fold(T::zero(), |a, b| if b > a { b } else { a });
    [allowed, shortest * T::real(1.3)].into_iter().filter(|duration| *duration <= allowed).any(|duration| {
        Path::<T, DIM>::straight(view, duration).is_ok_and(|line| {
            violations(view, &line, &mut scratch).feasible()
                && value(view, &line, Extreme::Exact, &mut scratch).finite()
        })
    })
}

fn is_finite<T: Real, const DIM: usize>(plan: &Path<T, DIM>) -> bool {
    let nodes = plan.nodes();
    let track = |track: &quietpath_core::trajectory::Track<T, DIM, NODES>| {
        track.path.iter().take(nodes).flat_map(|position| position.iter()).all(|part| part.finite())
            && [&track.jam, &track.azimuth, &track.dropout]
                .iter()
                .all(|control| control.iter().take(nodes).all(|number| number.finite()))
    };
    plan.times.iter().take(nodes).all(|time| time.finite()) && plan.active().iter().all(track)
}

/// Flies a problem in steps, thrown off its path now and then.
///
/// # Errors
/// The promise that was broken.
pub fn roll<T: Real, const DIM: usize>(
    problem: &Problem<T, DIM>,
    settings: &Settings<T>,
    dice: &mut Dice<'_>,
) -> Result<(), Broken> {
    let Ok(stored) = problem.stored() else { return Ok(()) };
    let view = stored.view();
    let Ok(mut flight) = Horizon::<T, DIM, NODES, AGENTS>::new(&view) else { return Ok(()) };
    let mut memory: Box<Memory<T, DIM>> = Box::new(Workspace::new());
    for _ in 0..STEPS {
        let search = if dice.one_in(3) { Search::Anew } else { Search::Tail };
        let before = flight.tail().clone();
        match flight.replan(&view, settings, search, &mut memory, &mut || false) {
            Ok(step) if step.feasible && !is_finite(flight.tail()) => {
                return Err(Broken(format!("a feasible tail has numbers that are not finite: {step:?}")));
            }
            Ok(_) => {}
            Err(error) if flight.tail() != &before && is_finite(&before) => {
                return Err(Broken(format!("{error}: the tail was to stay")));
            }
            Err(_) => {}
        }
        if dice.one_in(3) {
            let state = |_| State { position: dice.point(0.0, 10.0), velocity: dice.point(-0.2, 0.2) };
            let states: Vec<State<T, DIM>> = (0..view.agents.len()).map(state).collect();
            let before = is_finite(flight.tail());
            let time = flight.tail().start_time() + dice.real(0.0, 30.0);
            if flight.resume(time, &states).is_ok() && before && !is_finite(flight.tail()) {
                return Err(Broken(format!(
                    "finite states at {time:?} bend the tail out of all numbers: {states:?}"
                )));
            }
        } else {
            flight.fly(1 + dice.below(4));
        }
        if flight.has_arrived() {
            break;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dice::Mood;
    use fastrand::Rng;

    type Plan = Path<f64, 2>;

    /// A problem that has a plan, and what came of it.
    fn planned() -> (Problem<f64, 2>, Outcome<f64, 2>, Plan) {
        let mut random = Rng::with_seed(8);
        for _ in 0..50 {
            let bytes: Vec<u8> = (0..2048).map(|_| random.u8(..)).collect();
            let problem = Problem::<f64, 2>::draw(&mut Dice::new(&bytes, Mood::Sane));
            let Ok(stored) = problem.stored() else { continue };
            let mut memory: Box<Memory<f64, 2>> = Box::new(Workspace::new());
            let outcome = plan(&stored.view(), &Settings::default(), Start::Global, &mut memory, &mut || false);
            if let Ok(outcome) = outcome
                && matches!(outcome.status, Status::Converged | Status::IterationLimit)
            {
                return (problem, outcome, memory.best().clone());
            }
        }
        panic!("one in fifty can be planned");
    }

    #[test]
    fn what_is_wrong_with_a_plan_is_seen() {
        let (problem, outcome, best) = planned();
        let stored = problem.stored().expect("it was planned");
        let view = stored.view();
        let says = |change: &dyn Fn(&mut Outcome<f64, 2>, &mut Plan)| {
            let (mut outcome, mut best) = (outcome, best.clone());
            change(&mut outcome, &mut best);
            wrong(&view, &Settings::default(), &outcome, &best).unwrap_or_default()
        };
        assert_eq!(says(&|_, _| {}), "");
        assert!(says(&|outcome, _| outcome.objective += 1e-6).contains("another objective"));
        assert!(says(&|outcome, _| outcome.objective = f64::NAN).contains("another objective"));
        assert!(says(&|_, best| best.tracks[0].path[1][0] = 1e3).contains("an infeasible plan a plan"));
        assert!(says(&|_, best| best.tracks[0].path[1][0] = f64::NAN).contains("infeasible"));
        assert!(says(&|_, best| best.tracks[0].azimuth[1] = f64::NAN).contains("not finite"));
        assert!(says(&|outcome, _| outcome.iterations = usize::MAX / 2).contains("without end"));
        assert!(says(&|outcome, _| outcome.status = Status::Infeasible).contains("does not say why"));
    }
}
