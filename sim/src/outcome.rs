//! How a command ends, and how it speaks: exit statuses, error messages, standard output and progress.
//!
//! | exit status | meaning |
//! |---|---|
//! | 0 | done |
//! | 1 | the plan is not feasible |
//! | 2 | bad input or usage, or a file that cannot be written |
//!
//! A reader that closes the pipe (`quietpath .. | head -1`) ends the program quietly.

use std::fmt;
use std::io::{self, IsTerminal as _, Write as _};
use std::path::Path;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// How a command that ran ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It did what was asked.
    Done,
    /// The plan is not feasible.
    Infeasible,
}

impl Verdict {
    /// The verdict on a plan.
    #[must_use]
    pub const fn on(feasible: bool) -> Self {
        if feasible { Self::Done } else { Self::Infeasible }
    }

    /// The exit status.
    #[must_use]
    pub const fn status(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Infeasible => 1,
        }
    }
}

/// Why a command could not be carried out.
#[derive(Debug)]
pub enum Failure {
    /// Bad input or usage, or a file that cannot be written; the text is for the user.
    Input(String),
    /// Whoever read the output has gone.
    Pipe,
}

impl Failure {
    /// Bad input, in the words of an error.
    #[must_use]
    pub fn input(cause: impl fmt::Display) -> Self {
        Self::Input(cause.to_string())
    }

    /// A file or folder that cannot be written.
    #[must_use]
    pub fn write(path: &Path, cause: &io::Error) -> Self {
        Self::Input(format!("cannot write {}: {cause}", path.display()))
    }

    /// The exit status.
    #[must_use]
    pub const fn status(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Pipe => 0,
        }
    }
}

impl<E: fmt::Display> From<Box<E>> for Failure {
    fn from(cause: Box<E>) -> Self {
        Self::input(cause)
    }
}

/// Writes a file.
///
/// # Errors
/// Names the file that cannot be written.
pub fn write_file(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    std::fs::write(path, bytes).map_err(|cause| Failure::write(path, &cause))
}

/// Writes a file so that it is there whole or not at all, whatever ends the program meanwhile.
///
/// # Errors
/// Names the file that cannot be written.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let mut partial = path.as_os_str().to_owned();
    partial.push(".partial");
    let written = std::fs::write(&partial, bytes).and_then(|()| std::fs::rename(&partial, path));
    written.map_err(|cause| Failure::write(path, &cause))
}

/// Where text for the user goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stream {
    /// Standard output.
    Out,
    /// Standard error.
    Err,
}

/// Writes text as it is to a standard stream; styles in it show on terminals alone.
///
/// # Errors
/// [`Failure::Pipe`] where the reader has gone; other causes by name.
pub fn say(stream: Stream, text: &str) -> Result<(), Failure> {
    let written = match stream {
        Stream::Out => {
            let mut out = anstream::stdout().lock();
            out.write_all(text.as_bytes()).and_then(|()| out.flush())
        }
        Stream::Err => {
            let mut err = anstream::stderr().lock();
            err.write_all(text.as_bytes()).and_then(|()| err.flush())
        }
    };
    written.map_err(|cause| match cause.kind() {
        io::ErrorKind::BrokenPipe => Failure::Pipe,
        _ => Failure::Input(format!("cannot write to the standard stream: {cause}")),
    })
}

/// Reports a failure on standard error; nobody may be there to read it.
pub fn report(failure: &Failure) {
    if let Failure::Input(text) = failure {
        let style = anstyle::AnsiColor::Red.on_default().bold();
        let _ = say(Stream::Err, &format!("{style}error:{style:#} {text}\n"));
    }
}

/// A sign of life on a terminal while `work` runs; nothing in a pipe.
pub fn with_progress<R>(what: &'static str, work: impl FnOnce() -> R) -> R {
    if !io::stderr().is_terminal() {
        return work();
    }
    let spinner = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {elapsed}") {
        spinner.set_style(style);
    }
    spinner.set_message(what);
    spinner.enable_steady_tick(Duration::from_millis(120));
    let result = work();
    spinner.finish_and_clear();
    result
}

/// A bar that shows on a terminal how much of a task is done; nothing in a pipe.
#[must_use]
pub fn progress_bar(what: &'static str) -> ProgressBar {
    if !io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(Some(0), ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {wide_bar} {pos}/{len} {elapsed}") {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar.enable_steady_tick(Duration::from_millis(120));
    bar
}

/// A bar above a line that says where a flight stands; nothing in a pipe.
#[must_use]
pub fn flight_bar(what: &'static str, parts: u64) -> ProgressBar {
    let bar = progress_bar(what);
    bar.set_length(parts);
    if let Ok(style) = ProgressStyle::with_template("{spinner} {wide_bar} {percent} % {elapsed}\n  {wide_msg}") {
        bar.set_style(style);
    }
    bar
}

/// A bar with the time that is left, for many equal parts of a task; nothing in a pipe.
#[must_use]
pub fn counting_bar(what: &'static str, parts: u64) -> ProgressBar {
    let bar = progress_bar(what);
    bar.set_length(parts);
    if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} {wide_bar} {pos}/{len} {elapsed}, {eta} left") {
        bar.set_style(style);
    }
    bar
}
