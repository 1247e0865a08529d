//! `quietpath report`: a plan as one page.

use quietpath_bridge::file::PlanFile;
use quietpath_bridge::planning;

use super::{load, plan::background};
use crate::cli::ReportArgs;
use crate::outcome::{Failure, Stream, Verdict, say, with_progress, write_file};
use crate::page::{self, Story, Way};

/// Writes the page.
///
/// # Errors
/// Files that cannot be read or written, or do not belong together.
pub fn run(args: &ReportArgs) -> Result<Verdict, Failure> {
    if args.scenario == "-" && args.plan == "-" {
        return Err(Failure::input("only one of scenario and plan can come from standard input"));
    }
    let scenario = load(&args.scenario)?;
    let plan = PlanFile::read(&args.plan)?;
    let assessment = planning::assess(&scenario, &plan, &args.plan)?;
    let story = Story {
        plan: &plan,
        assessment: &assessment,
        way: Way::Planned,
        steps: &[],
        wire: &[],
        background: background(&scenario, args.metric)?,
        settings: &[("plan file".to_owned(), args.plan.clone())],
    };
    let page = with_progress("drawing", || page::html(&scenario, &story))?;
    write_file(&args.out, page.as_bytes())?;
    say(Stream::Out, &format!("wrote {}\n", args.out.display()))?;
    Ok(Verdict::on(assessment.feasible))
}
