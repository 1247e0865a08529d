//! Tests under Miri and under sanitizers, which find what a test that passes does not show: undefined behaviour in the
//! dependencies of the core, and memory errors and races in those of the bridge. Our own crates have no unsafe code.
//!
//! They need a nightly toolchain: `rustup toolchain install nightly --component miri,rust-src`.

use crate::step::Step;

/// Tests of the core that Miri ends with in minutes: it is a thousand times slower than the processor.
const UNDER_MIRI: &str = "scenario:: constraints:: error:: horizon:: trajectory:: solver::banded solver::bounds \
                          special::gaussian jet:: math::";
/// The target that sanitizers are built for: with one, build scripts are left out.
const HOST: &str = "x86_64-unknown-linux-gnu";

/// What runs.
pub fn steps() -> Vec<Step> {
    let nightly = |name, arguments: &str| Step::new(name, "rustup", &format!("run nightly cargo {arguments}"));
    let tests = format!("--package quietpath-bridge --lib --test link --test replan --target {HOST}");
    vec![
        nightly("the core under Miri", &format!("miri test --package quietpath-core --lib -- {UNDER_MIRI}")),
        nightly("the bridge, its memory watched", &format!("test --target-dir target/sanitize/address {tests}"))
            .with_env("RUSTFLAGS", "-Zsanitizer=address"),
        // Locks of the standard library are seen only where it is built in the same way.
        nightly(
            "the bridge, its threads watched",
            &format!("test -Zbuild-std --target-dir target/sanitize/thread {tests}"),
        )
        .with_env("RUSTFLAGS", "-Zsanitizer=thread"),
    ]
}
