//! Every fault of `cargo xtask faults` in one process, over few seeds, and some of those of the programs.

use quietpath_bridge::flight::FlyMode;
use quietpath_tests::faults::{Fault, Fly, Row, all, page};

/// Seeds of each fault: both autopilots.
const SEEDS: std::ops::Range<u64> = 0..2;
/// Faults of the programs that every run of the tests flies, each in one mode.
const PROGRAMS: [(&str, FlyMode); 4] = [
    ("killed", FlyMode::Mission),
    ("disk-full", FlyMode::Guided),
    ("no-log", FlyMode::Guided),
    ("suspended", FlyMode::Guided),
];

fn named(name: &str) -> Fault {
    all().into_iter().find(|fault| fault.name == name).unwrap_or_else(|| panic!("no fault is named {name}"))
}

#[test]
fn in_one_process_every_fault_has_its_outcome() {
    let faults = all().into_iter().filter(|fault| matches!(fault.fly, Fly::Air(_)));
    let mut rows = Vec::new();
    for fault in faults {
        for mode in [FlyMode::Guided, FlyMode::Mission] {
            rows.extend(Row::fly(&fault, mode, SEEDS, 2));
        }
    }
    assert!(rows.len() > 40);
    let bad: Vec<String> = rows.iter().filter(|row| !row.is_good()).map(ToString::to_string).collect();
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}

#[test]
fn programs_that_are_killed_stopped_or_full_have_their_outcome() {
    let fly = |(name, mode): (&str, FlyMode)| Row::fly(&named(name), mode, 0..1, 1).expect("flown in this mode");
    let rows: Vec<Row> = std::thread::scope(|scope| {
        let flights = PROGRAMS.map(|choice| scope.spawn(move || fly(choice)));
        flights.into_iter().map(|flight| flight.join().expect("it lands")).collect()
    });
    let bad: Vec<String> = rows.iter().filter(|row| !row.is_good()).map(ToString::to_string).collect();
    assert!(bad.is_empty(), "{}", bad.join("\n"));
}

#[test]
fn an_outcome_that_is_not_expected_stands_in_the_table() {
    let mut fault = named("stop");
    fault.steered = fault.mission.or(named("none").steered);
    let row = Row::fly(&fault, FlyMode::Guided, 0..2, 1).expect("flown in this mode");
    assert!(!row.is_good() && row.to_string().contains("UNEXPECTED with --only stop --seed 0: holds"), "{row}");
    let page = page(&[row], "the command");
    assert!(page.contains("| somebody ends the bridge | setpoints | arrives | 2 | 0 | 2 |"), "{page}");
}
