//! The bridge's tests, instrumented, and the page of what came of them.
//!
//! Our own crates have no unsafe code; what they call has, and threads and sockets are where it shows. It needs a nightly
//! toolchain with sources, because the standard library is built with threads watched too:
//! `rustup toolchain install nightly --component rust-src`.

use std::path::Path;

use crate::watch::{self, Page, Watch};

/// The one target that both sanitizers are there for. It must be named, or build scripts are instrumented too.
const TARGET: &str = "x86_64-unknown-linux-gnu";

/// The bridge's tests with every access to memory watched, and with every access from another thread; writes
/// `docs/hardening/sanitizers.md`.
///
/// # Errors
/// A program that cannot be started, or a page that cannot be written.
pub fn sanitize(top: &Path) -> anyhow::Result<bool> {
    let watch = |what, sanitizer: &str, library: &str| Watch {
        what,
        arguments: format!(
            "test {library}--package quietpath-bridge --lib --bins --tests --target {TARGET} --target-dir target/{sanitizer}"
        ),
        environment: vec![("RUSTFLAGS", format!("-Zsanitizer={sanitizer}"))],
    };
    let watches = [
        watch("the bridge, addresses and leaks", "address", ""),
        // Uninstrumented locks of the library would be taken for races.
        watch("the bridge, threads", "thread", "-Zbuild-std "),
    ];
    let page = Page { title: "Sanitizers", command: "cargo xtask sanitize", place: "docs/hardening/sanitizers.md" };
    watch::all(&watches, &page, top)
}
