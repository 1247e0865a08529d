//! Scenario coordinates on the Earth.
//!
//! A scenario's x is east, y north and z up of its origin, in units of `unit_m` metres. Two questions must be
//! decided before such a point has a latitude, a longitude and an altitude:
//!
//! - **Horizontally**, (x, y) is a distance and a bearing from the origin *along the WGS-84 ellipsoid*
//!   (azimuthal equidistant), not in a plane that touches it. This is how ground stations measure and how
//!   autopilots lay their own local frames. Between two points r metres from the origin, distances differ from the
//!   scenario's by at most about r^2 / 6 R^2: 10 ppm at 50 km.
//! - **Vertically**, z is height, not distance from a plane: a level flight in the scenario is a level flight. A
//!   tangent plane would be 196 m above the ground 50 km from its origin.
//!
//! Altitude has two kinds, and never the one for the other ([`Altitude`]): a scenario in two dimensions flies
//! `altitude_m` above *home*; in three dimensions z = 0 lies `altitude_m` above *mean sea level*. Heights above the
//! WGS-84 ellipsoid do not occur: an autopilot's altitude is above mean sea level by its own geoid.
//!
//! | name | unit |
//! |---|---|
//! | `east`, `north`, z | scenario length unit |
//! | `latitude_deg`, `longitude_deg` | degrees, north and east positive |
//! | [`Altitude`] | m |
//!
//! Geodesics are Karney's, by `geographiclib-rs`: accurate to nanometres.

use geographiclib_rs::{DirectGeodesic, Geodesic, InverseGeodesic};

use crate::file::scenario::{Origin, ScenarioFile};

/// An altitude, m, with what it counts from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Altitude {
    /// Above the home position.
    AboveHome(f64),
    /// Above mean sea level.
    AboveSeaLevel(f64),
}

impl Altitude {
    /// The number, m.
    #[must_use]
    pub const fn meters(self) -> f64 {
        match self {
            Self::AboveHome(meters) | Self::AboveSeaLevel(meters) => meters,
        }
    }
}

/// A place on the Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Latitude, WGS-84 degrees.
    pub latitude_deg: f64,
    /// Longitude, WGS-84 degrees.
    pub longitude_deg: f64,
    /// Altitude.
    pub altitude: Altitude,
}

/// The axes of a scenario on the Earth.
#[derive(Clone, Debug)]
pub struct LocalFrame {
    geodesic: Geodesic,
    origin: Origin,
    unit_m: f64,
    dimension: usize,
}

impl LocalFrame {
    /// The frame of a scenario; `None` where its file gives no latitude and longitude.
    #[must_use]
    pub fn of(scenario: &ScenarioFile) -> Option<Self> {
        Some(Self::around(scenario.frame.origin?, scenario.frame.unit_m, scenario.dimension))
    }

    /// The frame around an origin, of `unit_m` metres a length unit, in two or three dimensions.
    #[must_use]
    pub fn around(origin: Origin, unit_m: f64, dimension: usize) -> Self {
        Self { geodesic: Geodesic::wgs84(), origin, unit_m, dimension }
    }

    /// A frame in two dimensions about an origin, `unit_m` metres a length unit.
    #[must_use]
    pub fn new(origin: Origin, unit_m: f64) -> Self {
        Self { geodesic: Geodesic::wgs84(), origin, unit_m, dimension: 2 }
    }

    /// Metres in a length unit.
    #[must_use]
    pub const fn unit_m(&self) -> f64 {
        self.unit_m
    }

    /// The origin on the ground: the place from which `altitude_m` counts in two dimensions, z = 0 in three.
    #[must_use]
    pub fn home(&self) -> Place {
        let altitude = if self.dimension == 3 {
            Altitude::AboveSeaLevel(self.origin.altitude_m)
        } else {
            Altitude::AboveHome(0.0)
        };
        Place { latitude_deg: self.origin.latitude_deg, longitude_deg: self.origin.longitude_deg, altitude }
    }

    /// The place of a position (length units; east, north and, in three dimensions, up).
    #[must_use]
    pub fn place(&self, position: &[f64]) -> Place {
        let coordinate = |axis: usize| position.get(axis).copied().unwrap_or_default();
        let (latitude_deg, longitude_deg) = self.latitude_longitude(coordinate(0), coordinate(1));
        let altitude = if self.dimension == 3 {
            Altitude::AboveSeaLevel(self.origin.altitude_m + coordinate(2) * self.unit_m)
        } else {
            Altitude::AboveHome(self.origin.altitude_m)
        };
        Place { latitude_deg, longitude_deg, altitude }
    }

    /// Latitude and longitude, degrees, of a point `east` and `north` of the origin, length units.
    #[must_use]
    pub fn latitude_longitude(&self, east: f64, north: f64) -> (f64, f64) {
        let (east, north) = (east * self.unit_m, north * self.unit_m);
        let bearing_deg = east.atan2(north).to_degrees();
        let (latitude, longitude) = (self.origin.latitude_deg, self.origin.longitude_deg);
        self.geodesic.direct(latitude, longitude, bearing_deg, east.hypot(north))
    }

    /// The position of a place, length units: the inverse of [`LocalFrame::place`].
    ///
    /// In two dimensions the altitude has no part in it; in three it must be above sea level, otherwise `None`.
    #[must_use]
    pub fn position(&self, place: &Place) -> Option<Vec<f64>> {
        let (distance, bearing_deg, ..): (f64, f64, f64, f64) = self.geodesic.inverse(
            self.origin.latitude_deg,
            self.origin.longitude_deg,
            place.latitude_deg,
            place.longitude_deg,
        );
        let (sin, cos) = bearing_deg.to_radians().sin_cos();
        let mut position = vec![distance * sin / self.unit_m, distance * cos / self.unit_m];
        match (self.dimension, place.altitude) {
            (3, Altitude::AboveSeaLevel(meters)) => position.push((meters - self.origin.altitude_m) / self.unit_m),
            (3, Altitude::AboveHome(_)) => return None,
            _ => {}
        }
        Some(position)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(latitude_deg: f64, longitude_deg: f64, unit_m: f64, dimension: usize) -> LocalFrame {
        LocalFrame::around(Origin { latitude_deg, longitude_deg, altitude_m: 30.0 }, unit_m, dimension)
    }

    #[test]
    fn positions_come_back_to_the_millimetre_over_50_km() {
        let unit_m = 100.0;
        let mut worst = 0.0_f64;
        for (latitude, longitude) in [(-35.363262, 149.165237), (47.397742, 8.545594), (0.0, 179.9), (69.0, -180.0)] {
            let frame = frame(latitude, longitude, unit_m, 3);
            for east in [-500.0, -50.0, 0.0, 0.01, 300.0] {
                for north in [-400.0, -1.0, 0.0, 7.0, 500.0] {
                    let place = frame.place(&[east, north, 1.5]);
                    let back = frame.position(&place).expect("the altitude is above sea level");
                    for (a, b) in [east, north, 1.5].iter().zip(back) {
                        worst = worst.max((a - b).abs() * unit_m);
                    }
                }
            }
        }
        assert!(worst < 1e-6, "{worst} m");
    }

    #[test]
    fn axes_point_east_and_north_by_the_metres_of_the_ellipsoid() {
        // A degree of latitude at 45 degrees is 111 131.8 m, of longitude on the equator 111 319.5 m.
        let (latitude, longitude) = frame(45.0, 10.0, 1.0, 2).latitude_longitude(0.0, 1111.318);
        assert!((latitude - 45.01).abs() < 1e-6 && (longitude - 10.0).abs() < 1e-12, "{latitude} {longitude}");
        let (latitude, longitude) = frame(0.0, 10.0, 1000.0, 2).latitude_longitude(1.113195, 0.0);
        assert!(latitude.abs() < 1e-12 && (longitude - 10.01).abs() < 1e-8, "{latitude} {longitude}");
    }

    #[test]
    fn altitude_counts_from_home_in_two_and_from_the_sea_in_three_dimensions() {
        let place = frame(47.0, 8.0, 100.0, 2).place(&[1.0, 2.0]);
        assert_eq!(place.altitude, Altitude::AboveHome(30.0));
        let frame = frame(47.0, 8.0, 100.0, 3);
        let place = frame.place(&[1.0, 2.0, 0.5]);
        assert_eq!(place.altitude, Altitude::AboveSeaLevel(80.0));
        assert_eq!(frame.position(&Place { altitude: Altitude::AboveHome(80.0), ..place }), None);
    }

    #[test]
    fn distances_stay_within_ten_parts_in_a_million_at_50_km() {
        let frame = frame(50.62, -1.38, 1.0, 2);
        let (a, b) = ([50_000.0, 0.0], [0.0, 50_000.0]);
        let ((lat1, lon1), (lat2, lon2)) =
            (frame.latitude_longitude(a[0], a[1]), frame.latitude_longitude(b[0], b[1]));
        let distance: f64 = frame.geodesic.inverse(lat1, lon1, lat2, lon2);
        let expected = 50_000.0 * 2.0_f64.sqrt();
        assert!((distance / expected - 1.0).abs() < 1.1e-5, "{}", distance / expected - 1.0);
    }
}
