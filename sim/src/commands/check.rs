//! `quietpath check`: what a plan is worth, recomputed from its path alone.

use quietpath_bridge::file::PlanFile;
use quietpath_bridge::planning;

use super::load;
use crate::cli::CheckArgs;
use crate::outcome::{Failure, Stream, Verdict, say};
use crate::report;

/// Prints objective, violations and the verdict.
///
/// # Errors
/// Files that cannot be read, or do not belong together.
pub fn run(args: &CheckArgs) -> Result<Verdict, Failure> {
    if args.scenario == "-" && args.plan == "-" {
        return Err(Failure::input("only one of scenario and plan can come from standard input"));
    }
    let scenario = load(&args.scenario)?;
    let plan = PlanFile::read(&args.plan)?;
    let assessment = planning::assess(&scenario, &plan, &args.plan)?;
    say(Stream::Out, &report::check(&scenario, &plan, &assessment))?;
    Ok(Verdict::on(assessment.feasible))
}
