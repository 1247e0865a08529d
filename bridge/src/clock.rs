//! Time as an argument.
//!
//! Everything that decides takes the time with its input and never asks for it, so that tests run under a clock of
//! their own and a recorded flight replays bit for bit. [`Time`] counts microseconds from an arbitrary zero, never
//! backwards; it says nothing about the date.
//!
//! Only the threads around the decisions own a [`SystemClock`]. Against a simulated autopilot that has the same speed it may
//! run faster than time does ([`SystemClock::at_speed`]); everything that is told in seconds then is told in its seconds.

use std::ops::Add;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

/// A moment, microseconds since the clock's zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Time(u64);

impl Time {
    /// The clock's zero.
    pub const ZERO: Self = Self(0);

    /// A moment by its microseconds.
    #[must_use]
    pub const fn from_micros(micros: u64) -> Self {
        Self(micros)
    }

    /// A moment by its milliseconds.
    #[must_use]
    pub const fn from_millis(millis: u64) -> Self {
        Self(millis.saturating_mul(1000))
    }

    /// Microseconds since the clock's zero.
    #[must_use]
    pub const fn micros(self) -> u64 {
        self.0
    }

    /// Seconds since the clock's zero.
    #[must_use]
    pub fn seconds(self) -> f64 {
        self.0 as f64 * 1e-6
    }

    /// How long ago `earlier` was; zero where it lies ahead.
    #[must_use]
    pub const fn since(self, earlier: Self) -> Duration {
        Duration::from_micros(self.0.saturating_sub(earlier.0))
    }
}

impl Add<Duration> for Time {
    type Output = Self;

    fn add(self, span: Duration) -> Self {
        Self(self.0.saturating_add(u64::try_from(span.as_micros()).unwrap_or(u64::MAX)))
    }
}

/// The operating system's monotonic clock, counted from its making.
#[derive(Clone, Copy, Debug)]
pub struct SystemClock {
    begin: Instant,
    speed: f64,
}

impl SystemClock {
    /// A clock that reads zero now.
    #[must_use]
    pub fn start() -> Self {
        Self { begin: Instant::now(), speed: 1.0 }
    }

    /// A clock that reads zero now and runs `speed` times as fast as time: for simulations alone. `None` where that is no
    /// positive number.
    #[must_use]
    pub fn at_speed(speed: f64) -> Option<Self> {
        (speed.is_finite() && speed > 0.0).then(|| Self { begin: Instant::now(), speed })
    }

    /// The time.
    #[must_use]
    pub fn now(&self) -> Time {
        let elapsed = self.begin.elapsed();
        // Multiplied only where it must be: a span of real time is not rounded.
        Time::ZERO + if self.speed == 1.0 { elapsed } else { elapsed.mul_f64(self.speed) }
    }

    /// How long a span of this clock takes, for those who wait on the operating system.
    #[must_use]
    pub fn real(&self, span: Duration) -> Duration {
        if self.speed == 1.0 { span } else { span.div_f64(self.speed) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_clock_waits_shorter() {
        let clock = SystemClock::at_speed(50.0).expect("a clock");
        assert_eq!(clock.real(Duration::from_secs(5)), Duration::from_millis(100));
        std::thread::sleep(Duration::from_millis(20));
        assert!(clock.now() >= Time::from_millis(1000), "{:?}", clock.now());
        assert!([0.0, -1.0, f64::NAN, f64::INFINITY].into_iter().all(|speed| SystemClock::at_speed(speed).is_none()));
    }
}
