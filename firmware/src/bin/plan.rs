//! The built-in flight: one cold plan, then warm replans while a sensor moves; prints objectives and the bits of the
//! paths, which are those of the host, and the instructions that each plan took.
#![no_std]
#![no_main]

use cortex_m as _;
use cortex_m_rt::entry;
use defmt_semihosting as _;
use quietpath_firmware::{Counter, finish};
use quietpath_flight::{Error, Memory, begin, bits, fly, replan};
use static_cell::ConstStaticCell;

static MEMORY: ConstStaticCell<Memory> = ConstStaticCell::new(Memory::new());

#[entry]
fn main() -> ! {
    if let Err(error) = run(MEMORY.take()) {
        defmt::println!("error {}", error);
        finish(false);
    }
    finish(true)
}

fn run(memory: &mut Memory) -> Result<(), Error> {
    let mut counter = Counter::start();
    let mut flight = begin()?;
    for number in 0_u32.. {
        counter.lap();
        let step = replan(&mut flight, memory)?;
        let instructions = counter.lap();
        let outcome = &step.outcome;
        defmt::println!(
            "plan {=u32} objective {=u32:08x} iterations {=usize} refinements {=usize} factorizations {=usize} evaluations {=usize} projection_steps {=usize}",
            number,
            outcome.objective.to_bits(),
            outcome.iterations,
            outcome.refinements,
            outcome.factorizations,
            outcome.evaluations,
            outcome.projection_steps
        );
        for (node, [east, north]) in bits(&flight).enumerate() {
            defmt::println!("node {=usize} {=u32:08x} {=u32:08x}", node, east, north);
        }
        defmt::println!("instructions {=u64}", instructions);
        if !fly(&mut flight) {
            break;
        }
    }
    Ok(())
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    finish(false)
}
