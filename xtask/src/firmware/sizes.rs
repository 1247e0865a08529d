//! What the built-in flight takes: flash, static RAM, of it the planner's workspace, and stack.
//!
//! Flash and static RAM are those of the image `stack`, read off its sections; workspace and stack are what it prints: the
//! stack is painted before it flies, and was used as deep as the paint is gone. The problem and the rolling horizon, which
//! keeps what warm-starts the next plan, live on the stack, so that all of the flight is in the sum.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, bail};
use object::{Object, ObjectSection, SectionFlags, elf};

use super::image;
use super::parts::{PARTS, Part};
use super::tools;

/// The committed table.
const TABLE: &str = "firmware/sizes.md";

/// What one configuration takes, in bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Sizes {
    flash: u64,
    statics: u64,
    workspace: u64,
    horizon: u64,
    scenario: u64,
    stack: u64,
}

impl Sizes {
    const HEAD: &str = "| configuration | flash | static RAM | of it workspace | stack | of it horizon | of it scenario | \
                        RAM in all |\n|---|---|---|---|---|---|---|---|\n";

    fn ram(&self) -> u64 {
        self.statics + self.stack
    }

    fn row(&self, name: &str) -> String {
        let figures = [self.flash, self.statics, self.workspace, self.stack, self.horizon, self.scenario, self.ram()];
        figures.iter().fold(format!("| {name} |"), |row, figure| format!("{row} {figure} |"))
    }

    /// Reads a row back.
    fn of_row(row: &str) -> Option<Self> {
        let figures: Vec<u64> = row.split('|').filter_map(|cell| cell.trim().parse().ok()).collect();
        let [flash, statics, workspace, stack, horizon, scenario, _] = figures[..] else { return None };
        Some(Self { flash, statics, workspace, horizon, scenario, stack })
    }
}

/// What to do with the committed table.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Table {
    /// Nothing.
    Ignore,
    /// Print what changed against it.
    Compare,
    /// Write it anew.
    Write,
}

/// Measures and prints all configurations; false where one is past its budget.
///
/// # Errors
/// A tool that is missing, an image that does not build or run, a table that cannot be read or written.
pub fn sizes(table: Table, top: &Path) -> anyhow::Result<bool> {
    tools::provide(top)?;
    let mut rows = String::from(Sizes::HEAD);
    let mut good = true;
    let mut notes = String::new();
    let committed = if table == Table::Compare {
        std::fs::read_to_string(top.join(TABLE)).with_context(|| format!("cannot read {TABLE}"))?
    } else {
        String::new()
    };
    for part in &PARTS {
        image::build(part, top)?;
        let sizes = measure(part, top)?;
        writeln!(rows, "{}", sizes.row(part.name))?;
        for (what, size, most) in [("flash", sizes.flash, part.flash_max), ("RAM", sizes.ram(), part.ram_max)] {
            if size > most {
                good = false;
                writeln!(
                    notes,
                    "PAST THE BUDGET: {} takes {size} bytes of {what}, {} too many",
                    part.name,
                    size - most
                )?;
            }
        }
        if table == Table::Compare {
            notes.push_str(&changes(part, &sizes, &committed)?);
        }
    }
    println!(
        "\nBytes of the built-in flight, 32 intervals, 8 sensors, one agent, in single precision\n\n{rows}\n{notes}"
    );
    if table == Table::Write {
        let page = format!("<!-- Written by `cargo xtask sizes --write`. -->\n{rows}");
        std::fs::write(top.join(TABLE), page).with_context(|| format!("cannot write {TABLE}"))?;
    }
    Ok(good)
}

/// What is different from the committed row.
fn changes(part: &Part, now: &Sizes, committed: &str) -> anyhow::Result<String> {
    let row = committed.lines().find(|line| line.contains(part.name));
    let before = row.and_then(Sizes::of_row).with_context(|| {
        format!("{TABLE} has no row for the {}: write it anew with `cargo xtask sizes --write`", part.name)
    })?;
    let mut notes = String::new();
    for (what, before, now) in [
        ("flash", before.flash, now.flash),
        ("static RAM", before.statics, now.statics),
        ("stack", before.stack, now.stack),
    ] {
        let change = now.cast_signed() - before.cast_signed();
        if change != 0 {
            writeln!(notes, "{}: {what} {change:+} bytes", part.name)?;
        }
    }
    Ok(notes)
}

fn measure(part: &Part, top: &Path) -> anyhow::Result<Sizes> {
    let said = image::run(part, "stack", top)?;
    let figure = |word: &str| {
        let line =
            said.iter().find(|line| line.starts_with(word)).with_context(|| format!("no {word} was printed"))?;
        image::number_after(line, word)
    };
    let (flash, statics) = sections(&image::path(part, "stack", top))?;
    Ok(Sizes {
        flash,
        statics,
        workspace: figure("workspace")?,
        horizon: figure("horizon")?,
        scenario: figure("scenario")?,
        stack: figure("stack")?,
    })
}

/// Bytes of an image in flash, and of its statics in RAM.
fn sections(image: &Path) -> anyhow::Result<(u64, u64)> {
    let bytes = std::fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
    let file = object::File::parse(&*bytes)?;
    let (mut flash, mut statics) = (0, 0);
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { bail!("the image is not an ELF file") };
        if sh_flags & u64::from(elf::SHF_ALLOC) == 0 {
            continue;
        }
        let is_written = sh_flags & u64::from(elf::SHF_WRITE) != 0;
        let is_empty = section.file_range().is_none();
        // What is written to and not empty at first lies in both.
        flash += if is_empty { 0 } else { section.size() };
        statics += if is_written { section.size() } else { 0 };
    }
    Ok((flash, statics))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_read_back() {
        let sizes = Sizes { flash: 1, statics: 20, workspace: 3, horizon: 4, scenario: 5, stack: 60 };
        assert_eq!(Sizes::of_row(&sizes.row("a part, its name")), Some(sizes));
    }
}
