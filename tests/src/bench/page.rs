//! `docs/benchmarks.md`: one section a measurement, each replaced as a whole by the command that measures it.

use std::path::PathBuf;

use crate::repository;

const OPENING: &str = "# Benchmarks\n\nWritten by `cargo xtask bench`; do not edit by hand. Gaps are relative to \
max(1, |reference|), and negative where ours is better.\n";

/// Sections in the order of the page.
const ORDER: [&str; 4] = ["Published scenarios", "Random instances", "Scaling", "Landscapes"];

/// The page.
#[must_use]
pub fn path() -> PathBuf {
    repository().join("docs/benchmarks.md")
}

/// Replaces the section `title` by `body`.
///
/// # Errors
/// The page cannot be written.
pub fn write(title: &str, body: &str) -> std::io::Result<()> {
    let text = std::fs::read_to_string(path()).unwrap_or_default();
    if let Some(folder) = path().parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(path(), replaced(&text, title, body))
}

fn replaced(text: &str, title: &str, body: &str) -> String {
    let mut sections: Vec<(String, String)> = Vec::new();
    for part in text.split("\n## ").skip(1) {
        let (name, rest) = part.split_once('\n').unwrap_or((part, ""));
        sections.push((name.to_owned(), rest.trim().to_owned()));
    }
    sections.retain(|(name, _)| name != title);
    sections.push((title.to_owned(), body.trim().to_owned()));
    sections.sort_by_key(|(name, _)| ORDER.iter().position(|other| other == name).unwrap_or(ORDER.len()));
    let bodies = sections.iter().map(|(name, body)| format!("\n## {name}\n{body}\n"));
    format!("{OPENING}{}", bodies.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_section_is_replaced_and_the_others_stay_in_order() {
        let page = replaced("", "Scaling", "old");
        let page = replaced(&page, "Random instances", "drawn");
        let page = replaced(&page, "Scaling", "new\n\n| a |\n|---|");
        let rest = page.strip_prefix(OPENING).expect("the page opens as it should");
        assert_eq!(rest, "\n## Random instances\ndrawn\n\n## Scaling\nnew\n\n| a |\n|---|\n");
    }
}
