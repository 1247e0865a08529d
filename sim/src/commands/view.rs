//! `quietpath view`: a flight of the bridge, in a browser while it goes on.

use std::time::Instant;

use super::plan::background;
use crate::cli::ViewArgs;
use crate::fly;
use crate::outcome::{Failure, Stream, Verdict, say};
use crate::view::{Pace, Server, shown};

/// Shows a flight until a signal ends it.
///
/// # Errors
/// A file that is no record, a port that is taken.
pub fn run(args: &ViewArgs) -> Result<Verdict, Failure> {
    let server = Server::start(args.port)?;
    say(Stream::Err, &format!("the flight as it goes on: http://{}/ (Ctrl-C ends it)\n", server.address()))?;
    if !args.record.exists() {
        say(Stream::Err, &format!("waiting for {}, which is not there yet\n", args.record.display()))?;
    }
    let mut pace = Pace::default();
    fly::follow(&args.record, |look| {
        if !pace.is_due() && look.end.is_none() {
            return Ok(());
        }
        let begun = Instant::now();
        if let Some(page) = shown(look, background(look.world, args.metric)?)? {
            pace.shown(begun);
            server.show(page);
        }
        Ok(())
    })?;
    Ok(Verdict::Done)
}
