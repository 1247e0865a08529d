//! Links only if no panic is reachable from the public entry points of the core: its panic handlers call a function that
//! does not exist.
//!
//! It runs, too, but does nothing: what is asked of the core is hidden from the compiler, so that nothing is left out.
#![no_std]
#![no_main]

use core::hint::black_box;

use cortex_m_rt::entry;
use quietpath_firmware::finish;
use quietpath_flight::{begin, fly, replan, surface};

#[entry]
fn main() -> ! {
    black_box(begin as *const ());
    black_box(replan as *const ());
    black_box(fly as *const ());
    black_box(surface::check as *const ());
    black_box(surface::plan_from as *const ());
    black_box(surface::resume as *const ());
    black_box(surface::assess as *const ());
    black_box(surface::look as *const ());
    finish(true)
}

unsafe extern "C" {
    safe fn a_panic_is_reachable_from_the_core() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    a_panic_is_reachable_from_the_core()
}

// Its default panics, and the linker script keeps it.
#[defmt::panic_handler]
fn defmt_panic() -> ! {
    finish(false)
}
