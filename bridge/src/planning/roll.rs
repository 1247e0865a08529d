//! Planning a scenario file in steps, each with what can be known of the world when it begins.
//!
//! The steps are those of [`quietpath_core::horizon`]: the rest of the flight is planned in the world as it is seen, some
//! of it is flown, and the next step begins where that ends. `[rolling]` says how long steps are and what they know of
//! moving sensors. The world itself may change from step to step: sensors that are found, lost or moved, regions, limits
//! and another objective, as [`roll_through`] is told.
//!
//! What a step knows is not what it meets: the plan that was flown is weighed against the scenario as it is, with every
//! track. So its objective is not the sum of those of the steps, and a limit on a metric that every step kept in the world
//! as seen can be broken by a sensor that moved meanwhile.

use std::time::Instant;

use quietpath_core::Real;
use quietpath_core::horizon::{Horizon, Search, reveal};
use quietpath_core::scenario::View;
use quietpath_core::solver::{Status, Workspace};

use super::solve::{HostWorkspace, Options, Planned, Precision, settings, written};
use super::{Assessment, Choice, Obstacle, assess};
use crate::capacity::{HostHorizon, SENSORS};
use crate::file::plan::PlanTiming;
use crate::file::scenario::Rolling;
use crate::file::{FileError, PlanFile, ScenarioFile};

/// The status that the file of a flown plan has, where the plan is feasible.
const FLOWN: &str = "flown";

/// A step of a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Intervals flown before it.
    pub node: usize,
    /// Intervals flown of its plan.
    pub intervals: usize,
    /// The plan in force from here to the goals. Its objective is what it is worth in the world as seen.
    pub plan: PlanFile,
    /// Whether that plan is the step's own.
    pub choice: Choice,
    /// Whether it is feasible in the world as seen.
    pub feasible: bool,
    /// How much the world has changed since the step before: [`quietpath_core::horizon::Step::change`].
    pub change: f64,
    /// Why the planner stopped.
    pub status: Status,
    /// What stands in the way, where there is no feasible plan.
    pub obstacle: Option<Obstacle>,
    /// Iterations done.
    pub iterations: usize,
    /// Evaluations of the objective.
    pub evaluations: usize,
    /// Banded systems factored.
    pub factorizations: usize,
    /// Steps of the projection.
    pub projection_steps: usize,
}

impl Step {
    /// Time at which it begins, s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.plan.start_time
    }

    /// Time at which what is flown of its plan ends, s.
    #[must_use]
    pub fn end(&self) -> f64 {
        self.plan.node_times().get(self.intervals).copied().unwrap_or_else(|| self.time())
    }

    /// Duration of the planning call, s.
    #[must_use]
    pub fn plan_seconds(&self) -> f64 {
        self.plan.timing.map_or(0.0, |timing| timing.plan_seconds)
    }
}

/// A plan that was flown in steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Rolled {
    /// The plan that was flown, with the time of each node, ready to be written. Its objective is that of
    /// [`Rolled::assessment`].
    pub plan: PlanFile,
    /// The plan, weighed in double precision from its written numbers against the scenario with all its tracks.
    pub assessment: Assessment,
    /// The steps, at least one.
    pub steps: Vec<Step>,
}

impl Rolled {
    /// The first step that did not converge, or the first of all; one without a feasible plan comes before all others.
    fn telling(&self) -> Option<&Step> {
        let is_worse = |step: &&Step| step.status != Status::Converged;
        let find = |test: &dyn Fn(&&Step) -> bool| self.steps.iter().find(test);
        find(&|step| !step.feasible).or_else(|| find(&is_worse)).or_else(|| self.steps.first())
    }

    /// What stood in the way of the first step without a feasible plan.
    #[must_use]
    pub fn obstacle(&self) -> Option<&Obstacle> {
        self.telling().and_then(|step| step.obstacle.as_ref())
    }
}

impl From<Rolled> for Planned {
    /// The flown plan; the status is that of the first step that did not converge, the counts are those of all steps.
    fn from(rolled: Rolled) -> Self {
        let (status, obstacle) =
            rolled.telling().map_or((Status::Converged, None), |step| (step.status, step.obstacle.clone()));
        let sum = |count: fn(&Step) -> usize| rolled.steps.iter().map(count).sum();
        let (iterations, evaluations) = (sum(|step| step.iterations), sum(|step| step.evaluations));
        Self { plan: rolled.plan, assessment: rolled.assessment, status, obstacle, iterations, evaluations }
    }
}

/// Plans a scenario in steps, as its `[rolling]` says; `done` hears of each step.
///
/// A deadline and a number of iterations are those of each step; [`Options::rollout`] has no say here.
///
/// # Errors
/// A scenario without `[rolling]`; otherwise as [`super::plan`].
pub fn roll(
    scenario: &ScenarioFile,
    options: &Options,
    done: &mut (dyn FnMut(&Step) + Send),
) -> Result<Rolled, Box<FileError>> {
    roll_through(scenario, options, &mut |_| None, done)
}

/// Plans a scenario in steps while its world changes: `world` is asked at the time of each step, s, for the scenario as it
/// is by then, `None` for `scenario` itself. Sensors, regions, limits and objective may be others each time; agents, grid
/// and times are those of `scenario`.
///
/// The flown plan is weighed against `scenario`.
///
/// # Errors
/// As [`roll`]; a world with another number of agents or dimension.
pub fn roll_through(
    scenario: &ScenarioFile,
    options: &Options,
    world: &mut (dyn FnMut(f64) -> Option<ScenarioFile> + Send),
    done: &mut (dyn FnMut(&Step) + Send),
) -> Result<Rolled, Box<FileError>> {
    let Some(rolling) = scenario.rolling else {
        let help = "add [rolling] with `steps = 18`, or plan in one piece";
        return Err(scenario.error_at("rolling", "is missing, so that there are no steps to plan in", help));
    };
    let (mut plan, steps) = super::on_large_stack(|| {
        let mut crew = Crew { scenario, rolling, options, world, done };
        match (options.precision, scenario.dimension) {
            (Precision::F32, 3) => crew.fly::<f32, 3>(),
            (Precision::F32, _) => crew.fly::<f32, 2>(),
            (Precision::F64, 3) => crew.fly::<f64, 3>(),
            (Precision::F64, _) => crew.fly::<f64, 2>(),
        }
    })?;
    let assessment = assess(scenario, &plan, "the flown plan")?;
    plan.objective = Some(assessment.objective);
    let status = if assessment.feasible { FLOWN } else { Status::Infeasible.name() };
    plan.status = Some(status.to_owned());
    let plan_seconds = steps.iter().map(Step::plan_seconds).sum();
    plan.timing = Some(PlanTiming { plan_seconds });
    Ok(Rolled { plan, assessment, steps })
}

/// Who flies, and what they are told.
struct Crew<'a> {
    scenario: &'a ScenarioFile,
    rolling: Rolling,
    options: &'a Options,
    world: &'a mut (dyn FnMut(f64) -> Option<ScenarioFile> + Send),
    done: &'a mut (dyn FnMut(&Step) + Send),
}

impl Crew<'_> {
    /// Flies all steps; the flown plan, and the steps.
    fn fly<T: Real, const DIM: usize>(&mut self) -> Result<(PlanFile, Vec<Step>), Box<FileError>> {
        let mission = self.scenario.to_core::<T, DIM>()?;
        let begun = Horizon::new(&mission.view());
        let mut flight: Box<HostHorizon<T, DIM>> = Box::new(begun.map_err(|error| self.scenario.explain(&error))?);
        let mut workspace: Box<HostWorkspace<T, DIM>> = Box::new(Workspace::new());
        let mut steps: Vec<Step> = Vec::new();
        while !flight.has_arrived() {
            let changed = (self.world)(flight.tail().start_time().to_f64());
            let step = match &changed {
                None => self.step(self.scenario, &mission.view(), &mut flight, &mut workspace, &steps)?,
                Some(world) => {
                    let seen = world.to_core::<T, DIM>()?;
                    self.step(world, &seen.view(), &mut flight, &mut workspace, &steps)?
                }
            };
            (self.done)(&step);
            steps.push(step);
        }
        let flown = flight.flown();
        let mut times: Vec<f64> = flown.times.iter().take(flown.nodes()).map(|time| time.to_f64()).collect();
        if let Some(first) = times.first_mut() {
            *first = self.scenario.start_time;
        }
        let plan = PlanFile { times: Some(times), ..written(self.scenario, flown) };
        Ok((plan, steps))
    }

    /// Plans a step in a world as it is known, and flies it.
    fn step<T: Real, const DIM: usize>(
        &self,
        world: &ScenarioFile,
        view: &View<'_, T, DIM>,
        flight: &mut HostHorizon<T, DIM>,
        workspace: &mut HostWorkspace<T, DIM>,
        before: &[Step],
    ) -> Result<Step, Box<FileError>> {
        let time = flight.tail().start_time();
        let sensors = reveal::<_, DIM, SENSORS>(view, self.rolling.reveal, time, |_| true);
        let sensors = sensors.map_err(|error| world.explain(&error))?;
        let begin = Instant::now();
        let mut is_late = || self.options.deadline.is_some_and(|deadline| begin.elapsed() >= deadline);
        let seen = view.with_sensors(&sensors);
        let made = flight.replan(&seen, &settings(self.options), Search::Tail, workspace, &mut is_late);
        let plan_seconds = begin.elapsed().as_secs_f64();
        let made = made.map_err(|error| world.explain(&error))?;
        let outcome = made.outcome;
        let plan = PlanFile {
            start_time: time.to_f64(),
            objective: Some(outcome.objective.to_f64()),
            status: Some(outcome.status.name().to_owned()),
            timing: Some(PlanTiming { plan_seconds }),
            ..written(self.scenario, flight.tail())
        };
        let node = flight.flown().intervals();
        let (length, change) = (before.last().map_or(0, |step| step.intervals), made.change.to_f64());
        let wanted = self.rolling.cadence.length(self.scenario.intervals, before.len(), length, change);
        Ok(Step {
            node,
            intervals: flight.fly(wanted),
            plan,
            choice: made.choice,
            feasible: made.feasible,
            change,
            status: outcome.status,
            obstacle: outcome.obstacle.as_ref().map(Obstacle::from),
            iterations: outcome.iterations,
            evaluations: outcome.evaluations,
            factorizations: outcome.factorizations,
            projection_steps: outcome.projection_steps,
        })
    }
}
