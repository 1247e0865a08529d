//! What is wrong with a file, where, and what would be right.

use std::fmt;
use std::ops::Range;

/// Longest part of a line that an error shows, characters.
const EXCERPT_MAX: usize = 100;

/// A place in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Line, counted from 1.
    pub line: usize,
    /// Character in the line, counted from 1.
    pub column: usize,
    /// The line, shortened where it is long.
    pub excerpt: String,
}

impl Place {
    /// The place of a span of bytes.
    #[must_use]
    pub fn of(text: &str, span: &Range<usize>) -> Self {
        let before = text.get(..span.start.min(text.len())).unwrap_or(text);
        let line_start = before.rfind('\n').map_or(0, |index| index + 1);
        let line = before.matches('\n').count() + 1;
        let lead = before.get(line_start..).unwrap_or_default().chars().count();
        let whole = text.get(line_start..).unwrap_or_default().lines().next().unwrap_or_default();
        Self { line, column: lead + 1, excerpt: excerpt(whole, lead) }
    }
}

/// The line itself, or the part of it around the column.
fn excerpt(line: &str, lead: usize) -> String {
    let length = line.chars().count();
    if length <= EXCERPT_MAX {
        return line.trim_end().to_owned();
    }
    let first = lead.saturating_sub(EXCERPT_MAX / 2).min(length - EXCERPT_MAX);
    let part: String = line.chars().skip(first).take(EXCERPT_MAX).collect();
    let (left, right) = (if first > 0 { ".. " } else { "" }, if first + EXCERPT_MAX < length { " .." } else { "" });
    format!("{left}{}{right}", part.trim())
}

/// An invalid file: prints as file, line, field, fault, the line itself, and what would be right.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileError {
    /// The file, as the user named it; `<stdin>` for standard input.
    pub name: String,
    /// Where in it, where that is known.
    pub place: Option<Place>,
    /// The field, as a path from the top of the file: `agent[0].speed_max`. Empty for the file itself.
    pub field: String,
    /// What is wrong, to be read after the field.
    pub message: String,
    /// What would be right. May be empty.
    pub help: String,
}

impl FileError {
    /// An error about a whole file.
    #[must_use]
    pub fn whole(name: &str, message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { name: name.to_owned(), place: None, field: String::new(), message: message.into(), help: help.into() }
    }
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        if let Some(place) = &self.place {
            write!(f, ":{}", place.line)?;
        }
        f.write_str(": ")?;
        if !self.field.is_empty() {
            write!(f, "{} ", self.field)?;
        }
        f.write_str(&self.message)?;
        if let Some(place) = &self.place {
            write!(f, "\n  {} | {}", place.line, place.excerpt)?;
        }
        if !self.help.is_empty() {
            write!(f, "\n  help: {}", self.help)?;
        }
        Ok(())
    }
}

impl std::error::Error for FileError {}

/// Something in a file that is legal, but hardly meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning(pub FileError);

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "warning: {}", self.0)
    }
}

/// `` `a`, `b` or `c` ``.
pub(crate) fn listed(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match quoted.split_last() {
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
        None => "nothing".to_owned(),
    }
}

/// The name most like `given`, where one is like it at all.
pub(crate) fn similar<'a>(given: &str, names: &[&'a str]) -> Option<&'a str> {
    /// Jaro-Winkler similarity from which on a suggestion is worth making.
    const LIKENESS_MIN: f64 = 0.75;
    let given = given.to_lowercase();
    // One slip of the finger counts even where the name is too short for the likeness.
    let slip = |name: &str| if strsim::osa_distance(&given, name) == 1 { LIKENESS_MIN } else { 0.0 };
    let scored = names.iter().map(|name| (strsim::jaro_winkler(&given, name).max(slip(name)), *name));
    let best = scored.max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(likeness, _)| *likeness >= LIKENESS_MIN).map(|(_, name)| name)
}

/// `did you mean ..?` where a name is similar, then all names.
pub(crate) fn suggestion(given: &str, names: &[&str], what: &str) -> String {
    let all = format!("{what} {}", listed(names));
    match similar(given, names) {
        Some(name) => format!("did you mean `{name}`? {all}"),
        None => all,
    }
}
