//! Gives the linker the memory of the chosen part.

use std::path::PathBuf;

fn main() -> Result<(), std::io::Error> {
    let regions = if std::env::var_os("CARGO_FEATURE_M4F").is_some() { "memory-m4f.x" } else { "../memory.x" };
    let out = PathBuf::from(std::env::var_os("OUT_DIR").unwrap_or_default());
    std::fs::copy(regions, out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }
    println!("cargo:rerun-if-changed={regions}");
    Ok(())
}
