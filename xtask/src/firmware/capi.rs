//! The C interface: its header made from its source, its static library for host and microcontroller, and its example in C
//! on both, which must print the same bits.

use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, bail};

use super::image;
use super::parts::PARTS;
use super::tools::TARGET;

/// The header, its source, and the example.
const HEADER: &str = "capi/include/quietpath.h";
const SOURCE: &str = "capi/src/lib.rs";
const SETTINGS: &str = "capi/cbindgen.toml";
const EXAMPLES: &str = "capi/examples";
/// The package, and its static library.
const PACKAGE: &str = "quietpath-capi";
const LIBRARY: &str = "libquietpath_capi.a";
/// The planner that is the same on all of them.
const SMALLER: [&str; 2] = ["--features", "first-order"];
/// What every C compiler is told.
const STRICT: [&str; 6] = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", "-Icapi/include"];

/// Writes the header anew.
///
/// # Errors
/// A source that cannot be read, a header that cannot be written.
pub fn header(top: &Path) -> anyhow::Result<bool> {
    std::fs::create_dir_all(top.join("capi/include"))?;
    std::fs::write(top.join(HEADER), generated(top)?).with_context(|| format!("cannot write {HEADER}"))?;
    println!("{HEADER}");
    Ok(true)
}

fn generated(top: &Path) -> anyhow::Result<Vec<u8>> {
    let settings = cbindgen::Config::from_file(top.join(SETTINGS)).map_err(anyhow::Error::msg)?;
    let made = cbindgen::Builder::new().with_config(settings).with_src(top.join(SOURCE)).generate()?;
    let mut text = Vec::new();
    made.write(&mut text);
    Ok(text)
}

/// Compiles and runs the example on the host and on every part; false where it fails or prints something else.
///
/// # Errors
/// A header that is not what its source says, a library or example that does not build.
pub fn check(top: &Path) -> anyhow::Result<bool> {
    println!("\nC interface");
    if std::fs::read(top.join(HEADER)).with_context(|| format!("cannot read {HEADER}"))? != generated(top)? {
        bail!("{HEADER} is not what {SOURCE} says: make it anew with `cargo xtask header`");
    }
    let out = top.join("target/capi");
    std::fs::create_dir_all(&out)?;
    let on_host = on_host(top, &out)?;
    println!("  host: {}", summary(&on_host));
    let image = for_target(top, &out)?;
    let mut good = true;
    for part in &PARTS {
        let (is_good, said) = image::run_raw(part, &image)?;
        let is_same = is_good && said == on_host;
        println!("  {}: {}", part.name, if is_same { "the same bits" } else { "NOT THE SAME" });
        good &= is_same;
    }
    Ok(good)
}

/// The first line of what the example says, and how many there are.
fn summary(said: &str) -> String {
    format!("{}, {} lines", said.lines().next().unwrap_or("nothing"), said.lines().count())
}

fn on_host(top: &Path, out: &Path) -> anyhow::Result<String> {
    image::build_library(PACKAGE, &SMALLER, top)?;
    let program = out.join("fly");
    let library = top.join(image::ARTIFACTS).join("debug").join(LIBRARY);
    let sources = [source("fly.c"), source("port_host.c"), library];
    compile(top, "cc", &[], &sources, &["-lpthread", "-ldl", "-lm"], &program)?;
    let ran = Command::new(&program).output().with_context(|| format!("cannot start {}", program.display()))?;
    if !ran.status.success() {
        bail!("the example in C fails on the host: {}", ran.status);
    }
    Ok(String::from_utf8(ran.stdout)?)
}

fn for_target(top: &Path, out: &Path) -> anyhow::Result<PathBuf> {
    image::build_library(PACKAGE, &[&SMALLER[..], &["--target", TARGET, "--profile", "small"]].concat(), top)?;
    let program = out.join("fly.elf");
    let library = top.join(image::ARTIFACTS).join(TARGET).join("small").join(LIBRARY);
    let sources = [source("fly.c"), source("port_mps2.c"), library];
    let machine = [
        "-mcpu=cortex-m4",
        "-mthumb",
        "-mfloat-abi=hard",
        "-mfpu=fpv4-sp-d16",
        "-ffreestanding",
        "-nostdlib",
        "-Wl,--gc-sections,-z,noexecstack",
        "-Tcapi/examples/mps2.ld",
    ];
    compile(top, "arm-none-eabi-gcc", &machine, &sources, &["-lgcc"], &program)?;
    Ok(program)
}

fn source(name: &str) -> PathBuf {
    Path::new(EXAMPLES).join(name)
}

fn compile(
    top: &Path,
    compiler: &str,
    machine: &[&str],
    sources: &[PathBuf],
    libraries: &[&str],
    program: &Path,
) -> anyhow::Result<()> {
    let compiled = Command::new(compiler)
        .args(STRICT)
        .args(machine)
        .args(sources)
        .args(libraries)
        .arg("-o")
        .arg(program)
        .current_dir(top)
        .status()
        .with_context(|| format!("cannot start {compiler}, a C compiler"))?;
    if !compiled.success() {
        bail!("{compiler} does not compile the example");
    }
    Ok(())
}
