//! The house keeps its arrows: core <- bridge <- sim <- tests, and the core stands on four crates without `std`.

use std::collections::BTreeSet;

use cargo_metadata::{DependencyKind, Metadata, MetadataCommand, Package};

fn metadata() -> Metadata {
    MetadataCommand::new().exec().expect("cargo metadata describes the workspace")
}

/// The workspace of the microcontroller.
fn microcontroller() -> Metadata {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/../firmware/Cargo.toml");
    MetadataCommand::new().manifest_path(manifest).no_deps().exec().expect("cargo metadata describes the firmware")
}

fn package<'a>(metadata: &'a Metadata, name: &str) -> &'a Package {
    let found = metadata.workspace_packages().into_iter().find(|package| package.name.as_str() == name);
    found.unwrap_or_else(|| panic!("the workspace has a package {name}"))
}

/// Names of the packages that `package` depends on, of any kind: a test that points back is an arrow too.
fn arrows(package: &Package) -> BTreeSet<&str> {
    package.dependencies.iter().map(|dependency| dependency.name.as_str()).collect()
}

#[test]
fn nothing_points_back() {
    let metadata = metadata();
    let order = ["quietpath-core", "quietpath-bridge", "quietpath-sim", "quietpath-tests"];
    for (rank, name) in order.iter().enumerate() {
        let arrows = arrows(package(&metadata, name));
        for above in order[rank + 1..].iter().chain(&["quietpath-abuse"]) {
            assert!(!arrows.contains(above), "{name} depends on {above}, which stands above it");
        }
        if let Some(below) = rank.checked_sub(1).and_then(|below| order.get(below)) {
            assert!(arrows.contains(below), "{name} does not depend on {below}, on which it should stand");
        }
    }
    let microcontroller = microcontroller();
    for name in ["quietpath-capi", "quietpath-flight"] {
        let arrows = arrows(package(&microcontroller, name));
        assert_eq!(arrows, BTreeSet::from(["quietpath-core"]), "{name} stands on the core alone");
    }
    let abuse = arrows(package(&metadata, "quietpath-abuse"));
    assert!(
        !abuse.contains("quietpath-sim") && !abuse.contains("quietpath-tests"),
        "campaigns abuse the library alone"
    );
    let outside = arrows(package(&metadata, "xtask"));
    assert!(
        outside.iter().all(|name| !name.starts_with("quietpath")),
        "the developer loop stands outside: {outside:?}"
    );
}

#[test]
fn every_package_is_placed() {
    let metadata = metadata();
    let names: BTreeSet<_> = metadata.workspace_packages().iter().map(|package| package.name.to_string()).collect();
    let placed =
        ["quietpath-abuse", "quietpath-bridge", "quietpath-core", "quietpath-sim", "quietpath-tests", "xtask"];
    assert_eq!(names, placed.map(String::from).into(), "a new package needs its place in `nothing_points_back`");
}

#[test]
fn core_stands_on_four_crates_without_std() {
    let metadata = metadata();
    let core = package(&metadata, "quietpath-core");
    let normal = core.dependencies.iter().filter(|dependency| dependency.kind == DependencyKind::Normal);
    let (optional, always): (Vec<_>, Vec<_>) = normal.partition(|dependency| dependency.optional);
    let names = |list: &[&cargo_metadata::Dependency]| -> BTreeSet<String> {
        list.iter().map(|dependency| dependency.name.clone()).collect()
    };
    assert_eq!(names(&always), ["heapless", "libm", "nalgebra", "num-traits"].map(String::from).into());
    assert_eq!(names(&optional), ["defmt"].map(String::from).into());
    for dependency in &always {
        let has_std_default = ["nalgebra", "num-traits"].contains(&dependency.name.as_str());
        assert!(!(has_std_default && dependency.uses_default_features), "{} brings std by default", dependency.name);
        assert!(!dependency.features.iter().any(|feature| feature == "std" || feature == "alloc"), "{dependency:?}");
    }
    assert!(!core.features.contains_key("std"), "the core has no std feature: it is no_std unconditionally");
}
