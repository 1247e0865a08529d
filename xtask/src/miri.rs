//! Tests under Miri, and the page of what came of them.
//!
//! It finds what a test that passes does not show: undefined behaviour in what the core is built on. Our own crates have no
//! unsafe code. It needs a nightly toolchain: `rustup toolchain install nightly --component miri,rust-src`.

use std::path::Path;

use crate::watch::{self, Page, Watch};

/// Tests of the core that Miri ends with in minutes: it is a thousand times slower than the processor, and whole plans are
/// left to that.
const UNDER_MIRI: [(&str, &str); 2] = [
    ("--test model_violations", ""),
    (
        "--lib",
        "horizon:: metrics:: scenario:: solver::banded solver::controls solver::feasible solver::global special::gaussian",
    ),
];
/// Miri reads no assembly, which libm has where a processor computes a function itself, to the same bit.
const PLAIN: &str = "--features libm/force-soft-floats";

/// The core's tests under Miri, with debug assertions and without; writes `docs/hardening/miri.md`.
///
/// # Errors
/// A program that cannot be started, or a page that cannot be written.
pub fn miri(top: &Path) -> anyhow::Result<bool> {
    let watch = |what, checks: &str, (target, names): (&str, &str)| Watch {
        what,
        arguments: format!(
            "miri test --package quietpath-core {target} {PLAIN} --target-dir target/miri/{checks} -- {names}"
        ),
        environment: ["CARGO_PROFILE_DEV_DEBUG_ASSERTIONS", "CARGO_PROFILE_DEV_OVERFLOW_CHECKS"]
            .map(|name| (name, checks.to_owned()))
            .into(),
    };
    let [whole, units] = UNDER_MIRI;
    let watches = [
        watch("scenarios, paths and constraints, debug assertions on", "true", whole),
        watch("units of the core, debug assertions on", "true", units),
        watch("scenarios, paths and constraints, debug assertions off", "false", whole),
        watch("units of the core, debug assertions off", "false", units),
    ];
    let page = Page { title: "Miri", command: "cargo xtask miri", place: "docs/hardening/miri.md" };
    watch::all(&watches, &page, top)
}
