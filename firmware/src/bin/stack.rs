//! The built-in flight on a painted stack: prints how much of it was ever used.
#![no_std]
#![no_main]

use cortex_m as _;
use cortex_m_rt::entry;
use defmt_semihosting as _;
use quietpath_firmware::{finish, stack_used};
use quietpath_flight::{Error, Flight, Memory, Problem, begin, fly, replan};
use static_cell::ConstStaticCell;

static MEMORY: ConstStaticCell<Memory> = ConstStaticCell::new(Memory::new());

#[entry]
fn main() -> ! {
    let done = run(MEMORY.take());
    // Flight and problem live on the stack here, and are part of what is used of it.
    defmt::println!("workspace {=usize}", size_of::<Memory>());
    defmt::println!("horizon {=usize}", size_of::<Flight>());
    defmt::println!("scenario {=usize}", size_of::<Problem>());
    defmt::println!("stack {=usize}", stack_used());
    finish(done.is_ok())
}

#[inline(never)]
fn run(memory: &mut Memory) -> Result<(), Error> {
    let mut flight = begin()?;
    loop {
        replan(&mut flight, memory)?;
        if !fly(&mut flight) {
            return Ok(());
        }
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    finish(false)
}
