//! What the images have in common: the clock that counts instructions, the stack, and the way out.
//!
//! The machines are Arm's MPS2 boards as QEMU has them. With `-icount shift=0` QEMU lets a nanosecond pass for each
//! instruction, so that the 25 MHz timer counts instructions, 40 at a time.
#![no_std]

pub mod uart;

use core::ptr::{read_volatile, write_volatile};

use cortex_m_semihosting::debug;

/// Registers of the board's timer 0: control, value, reload. Source: Arm DDI 0479, section 3.4.
const TIMER: [*mut u32; 3] = [0x4000_0000 as *mut u32, 0x4000_0004 as *mut u32, 0x4000_0008 as *mut u32];
/// Instructions a tick, at one instruction a nanosecond.
pub const INSTRUCTIONS_A_TICK: u64 = 40;
/// What the start-up code paints the stack with.
const PAINT: u32 = 0xcccc_cccc;

unsafe extern "C" {
    static _stack_start: u32;
    static _stack_end: u32;
}

/// A clock that is the number of instructions so far.
pub struct Counter {
    last: u32,
}

impl Counter {
    /// Starts the timer.
    #[must_use]
    pub fn start() -> Self {
        let [control, value, reload] = TIMER;
        // SAFETY: these are the registers of a timer that nothing else uses.
        unsafe {
            write_volatile(reload, u32::MAX);
            write_volatile(value, u32::MAX);
            write_volatile(control, 1);
        }
        Self { last: u32::MAX }
    }

    /// Instructions since the last call, or the start.
    pub fn lap(&mut self) -> u64 {
        // SAFETY: as above; the timer counts down.
        let now = unsafe { read_volatile(TIMER[1]) };
        let ticks = self.last.wrapping_sub(now);
        self.last = now;
        u64::from(ticks) * INSTRUCTIONS_A_TICK
    }
}

/// Bytes of the stack that were ever used.
///
/// What was used and happens to hold the paint counts as unused, which at the deepest place is a few bytes at most.
#[must_use]
pub fn stack_used() -> usize {
    let (top, bottom) = (&raw const _stack_start, &raw const _stack_end);
    let mut place = bottom;
    // SAFETY: from `_stack_end` up to `_stack_start` lies the stack, by the linker script.
    unsafe {
        while place < top && read_volatile(place) == PAINT {
            place = place.add(1);
        }
    }
    top as usize - place as usize
}

/// Ends the emulation; success is the exit status 0.
pub fn finish(is_good: bool) -> ! {
    loop {
        debug::exit(if is_good { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    }
}
