//! What the firmware needs besides Rust: the target, QEMU, and a C compiler for it. What is missing is installed where that
//! can be done without asking, and named otherwise.

use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, bail};

/// What the firmware is compiled for: Cortex-M4F and Cortex-M7F without an operating system.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Programs, and the Debian packages that have them.
const PROGRAMS: [(&str, &str); 2] =
    [("qemu-system-arm", "qemu-system-arm"), ("arm-none-eabi-gcc", "gcc-arm-none-eabi")];

/// Sees to it that everything is there.
///
/// # Errors
/// What is missing, and how to install it.
pub fn provide(top: &Path) -> anyhow::Result<()> {
    let added = Command::new("rustup").args(["target", "add", TARGET]).current_dir(top).status();
    if !added.context("cannot start rustup, which installs the target: see https://rustup.rs")?.success() {
        bail!("cannot install the target {TARGET}: rustup says why above");
    }
    let missing: Vec<&str> =
        PROGRAMS.iter().filter(|(name, _)| !is_there(name)).map(|(_, package)| *package).collect();
    if missing.is_empty() {
        return Ok(());
    }
    println!("installing {}", missing.join(" "));
    let is_installed =
        apt(&["update"]) && apt(&[&["install", "--yes", "--no-install-recommends"], &missing[..]].concat());
    let absent: Vec<&str> = PROGRAMS.iter().map(|(name, _)| *name).filter(|name| !is_there(name)).collect();
    if !is_installed || !absent.is_empty() {
        bail!(
            "missing: {}. On Debian and Ubuntu: sudo apt-get install {}; elsewhere install QEMU for Arm and the GNU Arm \
             embedded toolchain",
            absent.join(", "),
            missing.join(" ")
        );
    }
    Ok(())
}

fn is_there(program: &str) -> bool {
    let quiet = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    quiet.is_ok_and(|status| status.success())
}

/// Runs apt-get as root, or by a sudo that does not ask; false where neither works.
fn apt(arguments: &[&str]) -> bool {
    let tried = [&["apt-get"][..], &["sudo", "--non-interactive", "apt-get"]];
    tried.iter().any(|words| {
        let command = Command::new(words[0])
            .args(&words[1..])
            .args(arguments)
            .env("DEBIAN_FRONTEND", "noninteractive")
            .stdout(Stdio::null())
            .status();
        command.is_ok_and(|status| status.success())
    })
}
