//! The board's first serial line, byte by byte: Arm's CMSDK UART.
//!
//! Source: Arm DDI 0479, section 3.3. Limits: no interrupts; waits for every byte. QEMU holds bytes back while the receive
//! buffer is full, so that nothing is lost during a plan; on a board the receiver belongs behind an interrupt.

use core::convert::Infallible;
use core::ptr::{read_volatile, write_volatile};

use embedded_io::{ErrorType, Read, Write};

/// Registers: data, state, control, baud rate divisor.
const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *const u32 = 0x4000_4004 as *const u32;
const CONTROL: *mut u32 = 0x4000_4008 as *mut u32;
const DIVISOR: *mut u32 = 0x4000_4010 as *mut u32;
/// Bits of the state.
const TRANSMIT_FULL: u32 = 1;
const RECEIVE_FULL: u32 = 2;
/// Transmitter and receiver enabled.
const ENABLED: u32 = 3;
/// 25 MHz over 115200 bits a second.
const BAUD_DIVISOR: u32 = 217;

/// The serial line, switched on.
pub struct Uart(());

impl Uart {
    /// Switches it on.
    #[must_use]
    pub fn start() -> Self {
        // SAFETY: these are the registers of a UART that nothing else uses.
        unsafe {
            write_volatile(DIVISOR, BAUD_DIVISOR);
            write_volatile(CONTROL, ENABLED);
        }
        Self(())
    }

    fn wait_until(&self, is_ready: impl Fn(u32) -> bool) {
        // SAFETY: as above.
        while !is_ready(unsafe { read_volatile(STATE) }) {}
    }
}

impl ErrorType for Uart {
    type Error = Infallible;
}

impl Read for Uart {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Infallible> {
        let Some(byte) = buffer.first_mut() else { return Ok(0) };
        self.wait_until(|state| state & RECEIVE_FULL != 0);
        // SAFETY: as above; the register holds a byte.
        *byte = (unsafe { read_volatile(DATA) } & 0xff) as u8;
        Ok(1)
    }
}

impl Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        let Some(&byte) = bytes.first() else { return Ok(0) };
        self.wait_until(|state| state & TRANSMIT_FULL == 0);
        // SAFETY: as above.
        unsafe { write_volatile(DATA, u32::from(byte)) };
        Ok(1)
    }

    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
