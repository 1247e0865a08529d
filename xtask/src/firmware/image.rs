//! An image: built by cargo, run by QEMU, its log decoded.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};

use super::parts::Part;
use super::tools::TARGET;

/// The firmware's manifest.
const MANIFEST: &str = "firmware/Cargo.toml";
/// Where its artifacts go.
pub const ARTIFACTS: &str = "target/firmware";
/// An emulation that takes longer than this hangs.
const PATIENCE: Duration = Duration::from_secs(300);

/// Builds all images for a part.
///
/// # Errors
/// An image that does not build; `no_panic` does not link where a panic is reachable.
pub fn build(part: &Part, top: &Path) -> anyhow::Result<()> {
    build_with(part, "", top)
}

/// The same with one more feature.
///
/// # Errors
/// An image that does not build.
pub fn build_with(part: &Part, feature: &str, top: &Path) -> anyhow::Result<()> {
    let mut command = cargo(top);
    command.args([
        "build",
        "--manifest-path",
        MANIFEST,
        "--quiet",
        "--bins",
        "--target",
        TARGET,
        "--profile",
        part.profile,
    ]);
    command.args(["--features", part.features, "--features", feature]);
    if !command.status().context("cannot start cargo")?.success() {
        bail!("the images for the {} do not build", part.name);
    }
    Ok(())
}

/// Builds a package that is a library, for the host or another target.
///
/// # Errors
/// A package that does not build.
pub fn build_library(package: &str, arguments: &[&str], top: &Path) -> anyhow::Result<()> {
    let mut command = cargo(top);
    command.args(["build", "--manifest-path", MANIFEST, "--quiet", "--package", package]).args(arguments);
    if !command.status().context("cannot start cargo")?.success() {
        bail!("the library {package} does not build");
    }
    Ok(())
}

/// Runs the built-in flight on the host, with a part's planner; the lines that it prints.
///
/// # Errors
/// A program that does not build or fails.
pub fn on_host(part: &Part, top: &Path) -> anyhow::Result<Vec<String>> {
    let arguments =
        ["run", "--manifest-path", MANIFEST, "--quiet", "--package", "quietpath-flight", "--example", "host"];
    let planner = ["--features", part.planner];
    let ran =
        cargo(top).args(arguments).args(planner).stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    if !ran.status.success() {
        bail!("the flight on the host fails");
    }
    Ok(String::from_utf8(ran.stdout)?.lines().map(String::from).collect())
}

/// Runs an image to its end; the lines of its log.
///
/// # Errors
/// An image that fails or does not end, a log that cannot be decoded.
pub fn run(part: &Part, name: &str, top: &Path) -> anyhow::Result<Vec<String>> {
    let path = path(part, name, top);
    let (is_good, log) = output(part, &path)?;
    let lines = decode(&path, &log, top)?;
    if !is_good {
        bail!("the image {name} failed on the {}; it said:\n{}", part.name, lines.join("\n"));
    }
    Ok(lines)
}

/// Runs an image that prints plain text; whether it ended well, and the text.
///
/// # Errors
/// An image that does not end, or prints no text.
pub fn run_raw(part: &Part, image: &Path) -> anyhow::Result<(bool, String)> {
    let (is_good, text) = output(part, image)?;
    Ok((is_good, String::from_utf8(text).context("the image printed no text")?))
}

/// Whether an image ended well, and all of what it said.
fn output(part: &Part, image: &Path) -> anyhow::Result<(bool, Vec<u8>)> {
    let mut child = emulate(part, image, &["-serial", "none"])?;
    let mut output = child.stdout.take().context("QEMU has an output")?;
    let reader = std::thread::spawn(move || {
        let mut said = Vec::new();
        output.read_to_end(&mut said).map(|_| said)
    });
    let is_good = wait(&mut child)?;
    let said = reader.join().map_err(|_| anyhow::anyhow!("the reader of the output panicked"))??;
    Ok((is_good, said))
}

/// Where an image lies.
pub fn path(part: &Part, name: &str, top: &Path) -> PathBuf {
    top.join(ARTIFACTS).join(TARGET).join(part.profile).join(name)
}

/// Starts an image; a nanosecond passes for each instruction.
///
/// # Errors
/// QEMU does not start.
pub fn emulate(part: &Part, image: &Path, more: &[&str]) -> anyhow::Result<Child> {
    Command::new("qemu-system-arm")
        .args(["-machine", part.machine, "-cpu", part.processor, "-display", "none", "-monitor", "none"])
        .args(["-chardev", "stdio,id=log,signal=off", "-semihosting-config", "enable=on,target=native,chardev=log"])
        .args(["-icount", "shift=0"])
        .args(more)
        .arg("-kernel")
        .arg(image)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .spawn()
        .context("cannot start qemu-system-arm")
}

/// Waits for the end, and ends what does not end by itself; whether it ended well.
///
/// # Errors
/// It took too long.
pub fn wait(child: &mut Child) -> anyhow::Result<bool> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status.success());
        }
        if start.elapsed() > PATIENCE {
            child.kill()?;
            child.wait()?;
            bail!("QEMU was still running after {} s", PATIENCE.as_secs());
        }
        std::thread::sleep(Duration::from_millis(20));
    }
}

/// The number behind a word of a line.
///
/// # Errors
/// There is none.
pub fn number_after(line: &str, word: &str) -> anyhow::Result<u64> {
    let found = line.split(' ').skip_while(|other| *other != word).nth(1);
    found.and_then(|number| number.parse().ok()).with_context(|| format!("no number after `{word}` in `{line}`"))
}

/// The messages of a log, by the strings that the image keeps.
fn decode(image: &Path, log: &[u8], top: &Path) -> anyhow::Result<Vec<String>> {
    let mut decoder = cargo(top)
        .args(["run", "--manifest-path", MANIFEST, "--quiet", "--package", "quietpath-decode", "--"])
        .arg(image)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .context("cannot start cargo")?;
    let mut input = decoder.stdin.take().context("the decoder has an input")?;
    let log = log.to_vec();
    let writer = std::thread::spawn(move || input.write_all(&log));
    let decoded = decoder.wait_with_output()?;
    let _ = writer.join();
    if !decoded.status.success() {
        bail!("the log of {} cannot be decoded", image.display());
    }
    Ok(String::from_utf8(decoded.stdout)?.lines().map(String::from).collect())
}

fn cargo(top: &Path) -> Command {
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(top);
    command.env("CARGO_TARGET_DIR", top.join(ARTIFACTS));
    command
}
