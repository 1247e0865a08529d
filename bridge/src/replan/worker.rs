//! The thread that plans.
//!
//! One job at a time, with a deadline; whoever asks never waits. A planner that panics is an answer like any other
//! failure. One that never comes back is noticed by who asked, and cannot be stopped: no further job is taken.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::planning::{self, Memory, Options};

use super::{Answer, Job};

/// A thread that plans. Dropping it lets the thread end with the job it has.
pub struct Worker {
    jobs: SyncSender<Job>,
    answers: Receiver<Answer>,
    _thread: JoinHandle<()>,
}

impl Worker {
    /// Starts the thread; plans may take `deadline`.
    ///
    /// # Errors
    /// The operating system gives no thread.
    pub fn start(deadline: Duration) -> std::io::Result<Self> {
        let (jobs, to_do) = mpsc::sync_channel::<Job>(1);
        let (done, answers) = mpsc::channel();
        let work = move || {
            let mut memory = Memory::default();
            while let Ok(job) = to_do.recv() {
                let number = job.number;
                let result = catch_unwind(AssertUnwindSafe(|| carry_out(&job, deadline, &mut memory)))
                    .unwrap_or_else(|_| Err("the planner panicked".to_owned()));
                if done.send(Answer { number, result }).is_err() {
                    return;
                }
            }
        };
        let thread = std::thread::Builder::new().name("plan".into()).spawn(work)?;
        Ok(Self { jobs, answers, _thread: thread })
    }

    /// Hands a job over; false where the thread still has one waiting.
    pub fn submit(&self, job: Job) -> bool {
        self.jobs.try_send(job).is_ok()
    }

    /// An answer that has come.
    #[must_use]
    pub fn answer(&self) -> Option<Answer> {
        self.answers.try_recv().ok()
    }
}

/// Plans a job.
///
/// # Errors
/// Why there is no plan.
pub fn carry_out(
    job: &Job,
    deadline: Duration,
    memory: &mut Memory,
) -> Result<(crate::file::PlanFile, bool), String> {
    let options = Options { deadline: Some(deadline), rollout: planning::Rollout::Once, ..Options::default() };
    let planned = planning::renew(&job.scenario, &job.tail, &options, memory).map_err(|error| error.to_string())?;
    Ok((planned.plan, planned.assessment.feasible))
}
