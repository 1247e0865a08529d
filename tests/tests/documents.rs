//! What the pages claim about the source is true: files and tests that they name exist.

use std::collections::BTreeMap;
use std::fs;

use quietpath_tests::repository;

/// Numbered equations of the paper.
const EQUATIONS: usize = 68;

/// The rows of a Markdown table's body as trimmed cells.
fn rows(page: &str, header: &str) -> Vec<Vec<String>> {
    let (_, after) = page.split_once(header).unwrap_or_else(|| panic!("no table with the header {header}"));
    let body = after.lines().skip(2).take_while(|line| line.starts_with('|'));
    body.map(|line| line.trim_matches('|').split(" |").map(|cell| cell.trim().to_owned()).collect()).collect()
}

/// What stands in backquotes.
fn quoted(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

/// `(6)` or `(30)-(33)` as numbers.
fn numbers(cell: &str) -> std::ops::RangeInclusive<usize> {
    let mut ends = cell.split('-').map(|part| part.trim_matches(['(', ')']).parse().expect("an equation's number"));
    let first = ends.next().expect("a number");
    first..=ends.next().unwrap_or(first)
}

fn page(path: &str) -> String {
    fs::read_to_string(repository().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"))
}

#[test]
fn every_equation_has_one_row_with_a_file_and_a_test_that_exist() {
    let mut seen = BTreeMap::new();
    for row in rows(&page("docs/equations.md"), "| number | what | file | test |") {
        let [number, _, file, test] = row.as_slice() else { panic!("four cells: {row:?}") };
        for equation in numbers(number) {
            *seen.entry(equation).or_insert(0) += 1;
        }
        if file.starts_with("Definition: ") {
            assert!(test.is_empty(), "{number}: nothing is computed, so nothing is tested");
            continue;
        }
        let files = quoted(file);
        assert!(!files.is_empty(), "{number}: no file");
        for path in files {
            assert!(repository().join(path).is_file(), "{number}: no file {path}");
        }
        let tests = quoted(test);
        let [path, functions @ ..] = tests.as_slice() else { panic!("{number}: no test") };
        let source = page(path);
        assert!(!functions.is_empty(), "{number}: no test named");
        for function in functions {
            assert!(source.contains(&format!("fn {function}()")), "{number}: no test {function} in {path}");
        }
    }
    let all: BTreeMap<_, _> = (1..=EQUATIONS).map(|equation| (equation, 1)).collect();
    assert_eq!(seen, all, "each equation stands once");
}

#[test]
fn every_failure_that_was_found_has_a_test_that_exists() {
    let found = rows(&page("docs/hardening/README.md"), "| found by | what was wrong | test |");
    assert!(found.len() > 10);
    for row in found {
        let [_, what, test] = row.as_slice() else { panic!("three cells: {row:?}") };
        let tests = quoted(test);
        let [path, function] = tests.as_slice() else { panic!("{what}: no test") };
        assert!(page(path).contains(&format!("fn {function}()")), "{what}: no test {function} in {path}");
    }
}

#[test]
fn paths_and_pictures_on_the_pages_exist() {
    for name in
        ["README.md", "ARCHITECTURE.md", "DESIGN.md", "CONTRIBUTING.md", "docs/equations.md", "docs/bridge.md"]
    {
        let text = page(name);
        let tops = ["core/", "bridge/", "sim/", "tests/", "xtask/", "docs/"];
        let paths =
            quoted_outside_fences(&text).into_iter().filter(|word| tops.iter().any(|top| word.starts_with(top)));
        for path in paths {
            assert!(repository().join(&path).exists(), "{name} names {path}");
        }
        for link in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            let is_local = !link.contains("://") && !link.starts_with('#');
            assert!(!is_local || repository().join(link).exists(), "{name} links to {link}");
        }
    }
}

#[test]
fn every_dependency_has_its_reason() {
    let metadata = cargo_metadata::MetadataCommand::new().exec().expect("cargo metadata describes the workspace");
    let design = page("DESIGN.md");
    let (_, table) = design.split_once("## Dependencies").expect("a list of dependencies");
    let listed = quoted(table);
    for package in metadata.workspace_packages() {
        for dependency in package.dependencies.iter().filter(|dependency| dependency.path.is_none()) {
            assert!(listed.contains(&dependency.name.as_str()), "{} uses {}: why?", package.name, dependency.name);
        }
    }
}

/// What stands in backquotes outside blocks of code.
fn quoted_outside_fences(text: &str) -> Vec<String> {
    let prose = text.split("```").step_by(2);
    prose.flat_map(|part| part.lines().flat_map(quoted).map(String::from).collect::<Vec<_>>()).collect()
}

#[test]
fn the_gallery_shows_its_pictures_and_there_are_no_others() {
    let text = page("docs/gallery.md");
    let shown: std::collections::BTreeSet<&str> =
        text.split("](gallery/").skip(1).filter_map(|rest| rest.split(')').next()).collect();
    let folder = fs::read_dir(repository().join("docs/gallery")).expect("the pictures");
    let there: std::collections::BTreeSet<String> =
        folder.flatten().map(|file| file.file_name().to_string_lossy().into_owned()).collect();
    assert!(shown.iter().copied().eq(there.iter().map(String::as_str)), "{shown:?} are shown, {there:?} are there");
    assert!(!text.contains("not planned"), "a scenario of the gallery is not planned");
}
