//! Instructions of the pieces of planning, by number of intervals and of sensors, as a page of the firmware.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, bail};

use super::image;
use super::parts::PARTS;
use super::tools;

/// The page.
const PAGE: &str = "firmware/instructions.md";

/// Counts on the part that is compiled for speed, prints the table and writes the page.
///
/// # Errors
/// A tool that is missing, an image that does not build or run.
pub fn instructions(top: &Path) -> anyhow::Result<bool> {
    tools::provide(top)?;
    let part = &PARTS[0];
    image::build_with(part, "count", top)?;
    let said = image::run(part, "count", top)?;
    let mut sizes = Vec::new();
    let mut order = Vec::new();
    let mut counts = BTreeMap::new();
    for line in said.iter().filter(|line| line.starts_with("count ")) {
        let [_, intervals, sensors, count, what] = line.splitn(5, ' ').collect::<Vec<_>>()[..] else {
            bail!("`{line}` is no count")
        };
        let size = (intervals.to_owned(), sensors.to_owned());
        if !sizes.contains(&size) {
            sizes.push(size.clone());
        }
        if !order.contains(&what) {
            order.push(what);
        }
        counts.insert((what, size), count);
    }
    let mut table = String::from("| intervals, sensors |");
    sizes.iter().try_for_each(|(intervals, sensors)| write!(table, " {intervals}, {sensors} |"))?;
    writeln!(table, "\n|---|{}", "--:|".repeat(sizes.len()))?;
    for what in order {
        write!(table, "| {what} |")?;
        for size in &sizes {
            let count =
                counts.get(&(what, size.clone())).with_context(|| format!("no count of {what} at {size:?}"))?;
            write!(table, " {count} |")?;
        }
        table.push('\n');
    }
    println!("\n{table}");
    let page = format!(
        "# Instructions\n\nWritten by `cargo xtask instructions`: one agent in the plane, single precision, {} compiled for speed, counted \
         by QEMU, 40 at a time. A metric is that of one node; the gradient is that of a whole path; plans have the settings \
         `frugal`. Compiled for the largest size.\n\n{table}",
        part.name
    );
    std::fs::write(top.join(PAGE), page).with_context(|| format!("cannot write {PAGE}"))?;
    Ok(true)
}
