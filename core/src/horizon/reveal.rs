//! What a step is told of where the sensors will be.

use heapless::Vec;

use crate::error::{Error, Fault, Item};
use crate::math::Real;
use crate::scenario::{Sighting, StoredSensor, View};

/// What a step knows of moving sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Reveal {
    /// Where they are: they are taken to stay there.
    #[default]
    Current,
    /// Where they are and how they move: they are taken to keep their velocity.
    Predicted,
    /// Their whole tracks.
    Known,
}

/// The sensors of `world` that are known at `time` (s), as a step there is told of them; sensor `index` is known where
/// `is_known(index)`. Put them in the place of those of `world` by [`View::with_sensors`].
///
/// # Errors
/// `sensor` where there are more than `SENSORS`.
pub fn reveal<T: Real, const DIM: usize, const SENSORS: usize>(
    world: &View<'_, T, DIM>,
    how: Reveal,
    time: T,
    is_known: impl Fn(usize) -> bool,
) -> Result<Vec<StoredSensor<T, DIM>, SENSORS>, Error> {
    let mut seen = Vec::new();
    for (_, &sensor) in world.sensors.iter().enumerate().filter(|(index, _)| is_known(*index)) {
        let (position, velocity) = world.sensor_state(&sensor, time);
        let told = match how {
            Reveal::Known => sensor,
            _ if !sensor.is_moving() => sensor,
            Reveal::Current => sensor.at_rest(position),
            Reveal::Predicted => sensor.steady(Sighting { time, position, velocity }),
        };
        seen.push(told).map_err(|_| {
            let fault = Fault::TooMany { count: world.sensors.len(), capacity: SENSORS };
            Error::new(Item::Scenario, "sensor", fault)
        })?;
    }
    Ok(seen)
}
