//! Everything that was ever found, and its neighbours, on stable.
//!
//! `fuzz/corpus/TARGET` holds seeds, and the smallest input of each fault that a fuzzer has found; scenarios are seeds
//! too. A fault that is found becomes a file there, with a name that says what it was.

use std::path::{Path, PathBuf};

use fastrand::Rng;
use quietpath_abuse::TARGETS;
use quietpath_abuse::problem::{Verdict, numbered, of_kind};

/// Neighbours of each seed that are tried.
const NEIGHBOURS: u64 = 4;

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    files.sort();
    files
}

/// The same bytes with a few changed, left out or doubled.
fn neighbour(bytes: &[u8], random: &mut Rng) -> Vec<u8> {
    let mut near = bytes.to_vec();
    for _ in 0..random.usize(1..4) {
        let (from, count) = (random.usize(..near.len().max(1)), random.usize(1..9));
        let until = (from + count).min(near.len());
        match random.u8(..3) {
            0 => near.get_mut(from..until).into_iter().flatten().for_each(|byte| *byte = random.u8(..)),
            1 => drop(near.drain(from..until)),
            _ => near.extend_from_within(from..until),
        }
    }
    near
}

/// Every input of a target's corpus keeps its promises, and so do its neighbours.
fn keeps(name: &str) {
    let (_, target) = TARGETS.into_iter().find(|(other, _)| *other == name).expect("a target");
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut random = Rng::with_seed(8);
    let mut seeds = files(&top.join("fuzz/corpus").join(name));
    assert!(!seeds.is_empty(), "{name} has no seeds");
    if name == "scenario" {
        seeds.extend(files(&top.join("sim/scenarios")));
    }
    for path in &seeds {
        let bytes = std::fs::read(path).expect("a seed is a file");
        // A panic names its seed.
        println!("{}", path.display());
        target(&bytes);
        for number in 0..NEIGHBOURS {
            println!("{} neighbour {number}", path.display());
            target(&neighbour(&bytes, &mut random));
        }
    }
}

#[test]
fn scenarios_keep_their_promises() {
    keeps("scenario");
}

#[test]
fn plans_keep_their_promises() {
    keeps("plan");
}

#[test]
fn observations_keep_their_promises() {
    keeps("observations");
}

#[test]
fn the_wire_keeps_its_promises() {
    keeps("wire");
}

#[test]
fn machines_keep_their_promises() {
    keeps("machines");
}

#[test]
fn problems_keep_their_promises() {
    keeps("problem");
}

/// Problems of `cargo xtask numbers` whose plans broke a promise: no way to go, a used workspace, a node at the edge of a window,
/// rounding, an anchor that bends.
#[test]
fn numbered_problems_that_were_found_keep_their_promises() {
    for index in [4, 5, 14, 15, 31, 54, 66, 67, 317, 321, 1528, 3298, 3299, 9255] {
        let (kind, mut draws) = numbered(8, index);
        let verdict =
            draws.find_map(|bytes| Some(of_kind(kind, &bytes)).filter(|found| *found != Ok(Verdict::Refused)));
        assert!(matches!(verdict, Some(Ok(_))), "problem {index}: {verdict:?}");
    }
}

#[test]
fn the_fuzzer_has_every_target_and_no_other() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let stem = |path: &PathBuf| path.file_stem().expect("a name").to_string_lossy().into_owned();
    let there: Vec<String> = files(&top.join("fuzz/fuzz_targets")).iter().map(stem).collect();
    let mut wanted: Vec<String> = TARGETS.iter().map(|(name, _)| (*name).to_owned()).collect();
    wanted.sort();
    assert_eq!(there, wanted);
    let here = include_str!("corpus.rs");
    let manifest = std::fs::read_to_string(top.join("fuzz/Cargo.toml")).expect("a manifest");
    for name in wanted {
        assert!(manifest.contains(&format!("name = \"{name}\"")), "fuzz/Cargo.toml has no binary {name}");
        assert!(here.contains(&format!("keeps(\"{name}\");")), "{name} has no test here");
    }
}
