//! `quietpath import`: a scenario from the files of others.

use std::io::Write as _;
use std::path::Path;

use quietpath_bridge::file::ScenarioFile;

use crate::cli::ImportArgs;
use crate::import;
use crate::outcome::{Failure, Stream, Verdict, say};

/// Writes the scenario, and says what was left out or assumed.
///
/// # Errors
/// Files that cannot be read, or have nothing in them; a file that exists and is not to be overwritten.
pub fn run(args: &ImportArgs) -> Result<Verdict, Failure> {
    let mut found = import::read(&args.files)?;
    let names: Vec<String> = args.files.iter().map(|file| file.display().to_string()).collect();
    let stem = |path: &Path| path.file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let to_stdout = args.out == Path::new("-");
    let named = if to_stdout { args.files.first().and_then(|file| stem(file)) } else { stem(&args.out) };
    let text = import::scenario(&mut found, &named.unwrap_or_else(|| "imported".into()), &names.join(", "))?;
    let shown = args.out.display();
    if to_stdout {
        say(Stream::Out, &text)?;
    } else {
        super::new::create(&args.out, args.force)?
            .write_all(text.as_bytes())
            .map_err(|cause| Failure::write(&args.out, &cause))?;
    }
    let mut words = format!(
        "{} sensors, {} regions, {} waypoints\n",
        found.sensors.len(),
        text.matches("[[region]]").count(),
        found.waypoints.len()
    );
    for note in &found.notes {
        words.push_str(&format!("note: {note}\n"));
    }
    // A scenario with assumed ends may be refused: said now, not when it is planned.
    if let Err(cause) = ScenarioFile::parse(&args.out.to_string_lossy(), &text) {
        words.push_str(&format!("to be put right before it can be planned: {cause}\n"));
    }
    if !to_stdout {
        words.push_str(&format!(
            "wrote {shown}\nnext: look at the lines marked `assumed`, then quietpath check {shown}\n"
        ));
    }
    say(Stream::Err, &words)?;
    Ok(Verdict::Done)
}
