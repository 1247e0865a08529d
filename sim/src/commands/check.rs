//! `quietpath check`: advice on a scenario; or what a plan is worth, recomputed from its path alone.

use quietpath_bridge::file::PlanFile;
use quietpath_bridge::planning;

use super::load;
use crate::advice;
use crate::cli::CheckArgs;
use crate::outcome::{Failure, Stream, Verdict, say};
use crate::report;

/// Prints advice; or objective, violations and the verdict on a plan.
///
/// # Errors
/// Files that cannot be read, or do not belong together.
pub fn run(args: &CheckArgs) -> Result<Verdict, Failure> {
    let Some(plan_path) = &args.plan else { return advise(args) };
    if args.scenario == "-" && plan_path == "-" {
        return Err(Failure::input("only one of scenario and plan can come from standard input"));
    }
    let scenario = load(&args.scenario)?;
    let plan = PlanFile::read(plan_path)?;
    let assessment = planning::assess(&scenario, &plan, plan_path)?;
    say(Stream::Out, &report::check(&scenario, &plan, &assessment))?;
    Ok(Verdict::on(assessment.feasible))
}

fn advise(args: &CheckArgs) -> Result<Verdict, Failure> {
    let scenario = load(&args.scenario)?;
    let advice = advice::advise(&scenario)?;
    say(Stream::Out, &advice.text())?;
    Ok(Verdict::on(advice.reachable))
}
