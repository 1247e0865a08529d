//! The firmware: built, run under QEMU, compared with the host bit for bit, and weighed.
//!
//! `parts` says for which microcontrollers, `tools` what is needed and how it gets here, `image` how an image is built, run
//! and understood, `sizes` and `counts` what it takes, `capi` is the C interface, `serial` the flight over MAVLink.

mod capi;
mod counts;
mod image;
mod parts;
mod serial;
mod sizes;
mod tools;

use std::path::Path;

use anyhow::{Context, bail};

use parts::{PARTS, Part};

pub use capi::header;
pub use counts::instructions;
pub use sizes::{Table, sizes};
pub use tools::TARGET;

/// Most instructions of a plan from nothing, and of one near the plan before, that the Cortex-M7 may need: 10 and 100 ms at
/// 480 MHz.
const COLD_MAX: u64 = 50_000_000;
const WARM_MAX: u64 = 5_000_000;

/// Builds every image for every part, runs them and compares; false where something does not hold.
///
/// # Errors
/// A tool that is missing and cannot be installed, an image that does not build or run.
pub fn target(top: &Path) -> anyhow::Result<bool> {
    tools::provide(top)?;
    let mut good = true;
    for part in &PARTS {
        println!("\n{}: {}", part.name, part.machine);
        // The image without panics is done when it links.
        image::build(part, top)?;
        good &= compare(part, &image::on_host(part, top)?, top)?;
        good &= serial::fly(part, top)?;
    }
    good &= capi::check(top)?;
    Ok(good)
}

/// The built-in flight on a part against the same on the host.
fn compare(part: &Part, host: &[String], top: &Path) -> anyhow::Result<bool> {
    let said = image::run(part, "plan", top)?;
    let is_count = |line: &&String| line.starts_with("instructions ");
    let flight: Vec<&String> = said.iter().filter(|line| !is_count(line)).collect();
    if let Some((number, (here, there))) =
        flight.iter().zip(host).enumerate().find(|(_, (here, there))| **here != *there)
    {
        println!("  line {} differs:\n    host   {there}\n    target {here}", number + 1);
        return Ok(false);
    }
    if flight.len() != host.len() {
        println!("  the host printed {} lines, the target {}", host.len(), flight.len());
        return Ok(false);
    }
    let counts = said.iter().filter(is_count).map(|line| image::number_after(line, "instructions"));
    let counts = counts.collect::<anyhow::Result<Vec<u64>>>()?;
    let plans: Vec<&String> = flight.into_iter().filter(|line| line.starts_with("plan ")).collect();
    if plans.is_empty() || plans.len() != counts.len() {
        bail!("{} plans with {} counts of instructions", plans.len(), counts.len());
    }
    println!("  {:<6} {:<12} {:>9} {:>15}", "plan", "objective", "path", "instructions");
    for (number, (plan, count)) in plans.iter().zip(&counts).enumerate() {
        let kind = if number == 0 { "cold" } else { "warm" };
        println!("  {kind:<6} {:<12} {:>9} {count:>15}", objective(plan)?, "as host");
    }
    let (cold, warm) = (counts[0], counts[1..].iter().copied().max().unwrap_or_default());
    let mut good = true;
    if part.is_timed {
        for (kind, count, most) in [("cold plan", cold, COLD_MAX), ("warm replan", warm, WARM_MAX)] {
            println!("  {kind}: {count} of {most} instructions");
            good &= count <= most;
        }
    }
    Ok(good)
}

/// The objective of a line of a plan, in figures.
fn objective(plan: &str) -> anyhow::Result<f32> {
    let bits = plan.split(' ').skip_while(|word| *word != "objective").nth(1).context("a plan has an objective")?;
    Ok(f32::from_bits(
        u32::from_str_radix(bits, 16).with_context(|| format!("`{bits}` are not the bits of a number"))?,
    ))
}
