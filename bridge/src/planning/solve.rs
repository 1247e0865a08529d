//! Planning a scenario file.

use std::any::Any;
use std::time::{Duration, Instant};

use quietpath_core::horizon::NEAR_ITERATIONS;
use quietpath_core::solver::{self, Settings, Start, Status, Workspace};
use quietpath_core::{Point, Real};

use super::assess::trajectory;
use super::{Assessment, Obstacle, assess, roll};
use crate::capacity::{AGENTS, HostTrajectory, NODES, SENSORS};
use crate::file::plan::{AgentPlan, PlanTiming};
use crate::file::{FileError, PlanFile, ScenarioFile};

/// Memory of the planner, host size.
pub type HostWorkspace<T, const DIM: usize> = Workspace<T, DIM, NODES, SENSORS, AGENTS>;

/// Memory for planning that is kept from one plan to the next: the system takes longer to give it than a short plan takes.
///
/// It holds nothing of the plans.
#[derive(Debug, Default)]
pub struct Memory(Option<Box<dyn Any + Send>>);

impl Memory {
    fn take<T: Real, const DIM: usize>(&mut self) -> Box<HostWorkspace<T, DIM>> {
        let kept = self.0.take().and_then(|kept| kept.downcast().ok());
        kept.unwrap_or_else(Self::make)
    }

    /// Apart from what plans: megabytes pass through the stack of whoever this is inlined into, each time.
    #[cold]
    #[inline(never)]
    fn make<T: Real, const DIM: usize>() -> Box<HostWorkspace<T, DIM>> {
        Box::new(Workspace::new())
    }

    fn keep<T: Real, const DIM: usize>(&mut self, workspace: Box<HostWorkspace<T, DIM>>) {
        self.0 = Some(workspace);
    }
}

/// The floating-point numbers that planning computes with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// Single, as on a microcontroller.
    F32,
    /// Double.
    #[default]
    F64,
}

/// What to do with a scenario that asks to be planned in steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rollout {
    /// As the scenario says: in the steps of its `[rolling]`, and otherwise in one piece.
    #[default]
    AsWritten,
    /// In one piece, with every track known.
    Once,
}

/// How to plan.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Options {
    /// The numbers to compute with.
    pub precision: Precision,
    /// Largest number of iterations; the planner's own choice where it is not given.
    pub iterations: Option<usize>,
    /// Largest number of projected-gradient iterations before the refinement, where fewer than the planner's own choice.
    pub gradient_iterations: Option<usize>,
    /// Time after which the best plan so far is returned, of each step where there are steps. With one, the same call may
    /// give different plans.
    pub deadline: Option<Duration>,
    /// Steps or one piece.
    pub rollout: Rollout,
}

/// A plan, and how it came about.
#[derive(Clone, Debug, PartialEq)]
pub struct Planned {
    /// The plan, ready to be written. Its objective is that of [`Planned::assessment`].
    pub plan: PlanFile,
    /// The plan, weighed in double precision from its written numbers.
    pub assessment: Assessment,
    /// Why the planner stopped.
    pub status: Status,
    /// What stands in the way, where there is no feasible plan; [`Obstacle::describe`] puts it into words.
    pub obstacle: Option<Obstacle>,
    /// Iterations done, of the projected gradient and of the refinement.
    pub iterations: usize,
    /// Evaluations of the objective.
    pub evaluations: usize,
}

/// Plans a scenario, from the best of several starts; in steps where it says so and [`Options::rollout`] leaves it to the
/// scenario, as [`roll()`] does.
///
/// `plan_seconds` of the plan is the time of the core's planning call alone. The objective is not what the core
/// computed on its way, but what the plan as written is worth in double precision: in single precision the
/// two differ by rounding, and a claim should be one that others can check.
///
/// # Errors
/// A part of the scenario that this version does not plan, by its place in the file.
pub fn plan(scenario: &ScenarioFile, options: &Options) -> Result<Planned, Box<FileError>> {
    if scenario.rolling.is_some() && options.rollout == Rollout::AsWritten {
        return roll(scenario, options, &mut |_| ()).map(Planned::from);
    }
    begin(scenario, options, None, &mut Memory::default())
}

/// Plans a scenario in one piece from an earlier plan, such as that of a scenario nearby.
///
/// What comes out is no worse than the earlier plan where that is feasible in this scenario; where it is not, or has
/// another number of intervals, this is [`plan`].
///
/// # Errors
/// As [`plan`]; an earlier plan that does not have the shape of the scenario: see [`PlanFile::fits`].
pub fn improve(scenario: &ScenarioFile, earlier: &PlanFile, options: &Options) -> Result<Planned, Box<FileError>> {
    earlier.fits("the earlier plan", scenario)?;
    begin(scenario, options, Some(earlier), &mut Memory::default())
}

/// Plans the rest of a flight from what is left of the plan that flies, as a step of the rolling horizon does: the earlier
/// plan is refined after a few iterations, and only where that finds nothing feasible is this [`improve`].
///
/// A deadline is that of each of the two.
///
/// # Errors
/// As [`improve`].
pub fn renew(
    scenario: &ScenarioFile,
    earlier: &PlanFile,
    options: &Options,
    memory: &mut Memory,
) -> Result<Planned, Box<FileError>> {
    earlier.fits("the earlier plan", scenario)?;
    let near = Options { gradient_iterations: Some(NEAR_ITERATIONS), ..*options };
    let planned = begin(scenario, &near, Some(earlier), memory)?;
    if planned.assessment.feasible { Ok(planned) } else { begin(scenario, options, Some(earlier), memory) }
}

fn begin(
    scenario: &ScenarioFile,
    options: &Options,
    earlier: Option<&PlanFile>,
    memory: &mut Memory,
) -> Result<Planned, Box<FileError>> {
    let Solved { mut plan, status, obstacle, iterations, evaluations } =
        super::on_large_stack(|| match (options.precision, scenario.dimension) {
            (Precision::F32, 3) => solve::<f32, 3>(scenario, options, earlier, memory),
            (Precision::F32, _) => solve::<f32, 2>(scenario, options, earlier, memory),
            (Precision::F64, 3) => solve::<f64, 3>(scenario, options, earlier, memory),
            (Precision::F64, _) => solve::<f64, 2>(scenario, options, earlier, memory),
        })?;
    let assessment = assess(scenario, &plan, "the plan")?;
    plan.objective = Some(assessment.objective);
    Ok(Planned { plan, assessment, status, obstacle, iterations, evaluations })
}

/// What the core says, its dimension and precision left behind.
struct Solved {
    plan: PlanFile,
    status: Status,
    obstacle: Option<Obstacle>,
    iterations: usize,
    evaluations: usize,
}

fn solve<T: Real, const DIM: usize>(
    scenario: &ScenarioFile,
    options: &Options,
    earlier: Option<&PlanFile>,
    memory: &mut Memory,
) -> Result<Solved, Box<FileError>> {
    let problem = scenario.to_core::<T, DIM>()?;
    let mut workspace = memory.take::<T, DIM>();
    let earlier = earlier.map(trajectory::<T, DIM>).transpose().map_err(|error| scenario.explain(&error))?;
    let start = earlier.as_deref().map_or(Start::Global, Start::Given);
    let begin = Instant::now();
    let mut is_late = || options.deadline.is_some_and(|deadline| begin.elapsed() >= deadline);
    let outcome = solver::plan(&problem.view(), &settings(options), start, &mut workspace, &mut is_late);
    let plan_seconds = begin.elapsed().as_secs_f64();
    let outcome = outcome.map_err(|error| scenario.explain(&error))?;
    let plan = PlanFile {
        status: Some(outcome.status.name().to_owned()),
        timing: Some(PlanTiming { plan_seconds }),
        ..written(scenario, workspace.best())
    };
    memory.keep(workspace);
    let (status, obstacle) = (outcome.status, outcome.obstacle.as_ref().map(Obstacle::from));
    Ok(Solved {
        plan,
        status,
        obstacle,
        iterations: outcome.iterations + outcome.refinements,
        evaluations: outcome.evaluations,
    })
}

/// The planner's bounds on its work.
pub(super) fn settings<T: Real>(options: &Options) -> Settings<T> {
    let mut settings = Settings::default();
    if let Some(iterations) = options.iterations {
        settings.iterations = iterations;
        settings.refinements = settings.refinements.min(iterations);
    }
    if let Some(iterations) = options.gradient_iterations {
        settings.iterations = settings.iterations.min(iterations);
    }
    settings
}

/// A trajectory as a plan of equal intervals that begins with the scenario.
pub(super) fn written<T: Real, const DIM: usize>(
    scenario: &ScenarioFile,
    trajectory: &HostTrajectory<T, DIM>,
) -> PlanFile {
    let nodes = trajectory.nodes();
    let doubles = |values: &[T]| -> Vec<f64> { values.iter().take(nodes).map(|value| value.to_f64()).collect() };
    let point = |position: &Point<T, DIM>| -> Vec<f64> { position.iter().map(|part| part.to_f64()).collect() };
    let agents = scenario.agents.iter().zip(trajectory.active()).map(|(entry, track)| {
        let mut path: Vec<Vec<f64>> = track.path.iter().take(nodes).map(point).collect();
        // Start and goal are exact in the file's numbers, which single precision rounds.
        for (end, exact) in [(0, &entry.start), (nodes.saturating_sub(1), &entry.goal)] {
            let is_rounded =
                |position: &Vec<f64>| position.iter().zip(exact).all(|(a, b)| *a == T::real(*b).to_f64());
            if let Some(position) = path.get_mut(end).filter(|position| is_rounded(position)) {
                position.clone_from(exact);
            }
        }
        AgentPlan {
            name: entry.name.clone(),
            path,
            jam: entry.jammer.is_some().then(|| doubles(&track.jam)),
            azimuth: entry.jammer.is_some().then(|| doubles(&track.azimuth)),
            dropout: entry.dropout.is_some().then(|| doubles(&track.dropout)),
        }
    });
    PlanFile {
        scenario: scenario.name.clone(),
        start_time: scenario.start_time,
        duration: trajectory.duration().to_f64(),
        agents: agents.collect(),
        ..PlanFile::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planning::STACK_BYTES;

    #[test]
    fn the_stack_holds_the_largest_structures_many_times() {
        let largest = size_of::<HostWorkspace<f64, 3>>() + size_of::<HostTrajectory<f64, 3>>();
        assert!(largest * 10 < STACK_BYTES, "{largest} bytes");
    }
}
