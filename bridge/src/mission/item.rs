//! Mission items on the wire, and when two lists are the same.
//!
//! The same plan is not the same list for every autopilot:
//!
//! | | ArduPilot | PX4 |
//! |---|---|---|
//! | item 0 | home, and replaced by the autopilot's own | the first waypoint |
//! | unused numbers | 0: it refuses NaN | heading NaN: "as you fly"; 0 would be north |
//! | what it keeps | altitudes in cm, delays, radii and headings as whole numbers | everything |
//!
//! So a read-back is compared with the tolerance of what autopilots keep, item 0 of ArduPilot is not compared, and
//! frames count as equal where only their names differ.

use num_traits::FromPrimitive;

use crate::file::mission::{Fence, FenceOutline, Item as FileItem, Mission};
use crate::frame::Place;
use crate::link::dialect::{MISSION_ITEM_INT_DATA, MavCmd, MavFrame};
use crate::telemetry::Autopilot;
use quietpath_core::scenario::Side;

use super::Talk;

/// Difference of latitude or longitude that storage may make, 1e-7 degrees: 2 cm.
const PLACE_TOLERANCE: i32 = 2;
/// Difference of altitude that storage may make, m.
const ALTITUDE_TOLERANCE: f32 = 0.02;
/// Difference of a number that is kept whole.
const WHOLE_TOLERANCE: f32 = 0.5;
/// Relative difference of other numbers.
const TOLERANCE: f32 = 1e-4;

/// One item, without addresses and without its place in the list.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Item {
    /// Command.
    pub command: MavCmd,
    /// Frame of the position.
    pub frame: MavFrame,
    /// Parameters 1 to 4.
    pub params: [f32; 4],
    /// Latitude, 1e-7 degrees, or parameter 5.
    pub x: i32,
    /// Longitude, 1e-7 degrees, or parameter 6.
    pub y: i32,
    /// Altitude, m, or parameter 7.
    pub z: f32,
    /// Whether the mission goes on by itself after it.
    pub autocontinue: bool,
}

/// Degrees as the wire counts them.
#[must_use]
pub fn wire_degrees(degrees: f64) -> i32 {
    // Latitudes and longitudes fit; casts of floats saturate.
    (degrees * 1e7).round() as i32
}

impl Item {
    /// The item of a mission file; `None` where its command or frame has no name.
    #[must_use]
    pub fn of(item: &FileItem) -> Option<Self> {
        Some(Self {
            command: MavCmd::from_u16(item.command)?,
            frame: MavFrame::from_u8(item.frame)?,
            params: item.params.map(|param| param as f32),
            x: wire_degrees(item.latitude_deg),
            y: wire_degrees(item.longitude_deg),
            z: item.altitude_m as f32,
            autocontinue: true,
        })
    }

    fn at(command: MavCmd, [latitude, longitude]: [f64; 2], param: f32) -> Self {
        Self {
            command,
            frame: MavFrame::MAV_FRAME_GLOBAL,
            params: [param, 0.0, 0.0, 0.0],
            x: wire_degrees(latitude),
            y: wire_degrees(longitude),
            z: 0.0,
            autocontinue: true,
        }
    }

    /// The item of a message.
    #[must_use]
    pub const fn received(data: &MISSION_ITEM_INT_DATA) -> Self {
        Self {
            command: data.command,
            frame: data.frame,
            params: [data.param1, data.param2, data.param3, data.param4],
            x: data.x,
            y: data.y,
            z: data.z,
            autocontinue: data.autocontinue != 0,
        }
    }

    /// The message that sends it.
    #[must_use]
    pub fn message(&self, talk: &Talk, seq: u16) -> MISSION_ITEM_INT_DATA {
        let [param1, param2, param3, param4] = self.params;
        MISSION_ITEM_INT_DATA {
            param1,
            param2,
            param3,
            param4,
            x: self.x,
            y: self.y,
            z: self.z,
            seq,
            command: self.command,
            target_system: talk.vehicle.system,
            target_component: talk.vehicle.component,
            frame: self.frame,
            current: u8::from(seq == 0),
            autocontinue: u8::from(self.autocontinue),
            mission_type: talk.list.mission_type(),
        }
    }

    /// Whether an item that was read back is the one that was sent, as far as autopilots keep it.
    #[must_use]
    pub fn is_kept_as(&self, kept: &Self) -> bool {
        let navigates = (self.command as u32) < 100;
        let param = |sent: f32, kept: f32| {
            let tolerance = if navigates { WHOLE_TOLERANCE } else { TOLERANCE * sent.abs().max(1.0) };
            sent.to_bits() == kept.to_bits() || (sent.is_nan() && kept.is_nan()) || (sent - kept).abs() <= tolerance
        };
        let has_place = navigates || (5000..=5100).contains(&(self.command as u32));
        self.command == kept.command
            && self.params.iter().zip(&kept.params).all(|(sent, kept)| param(*sent, *kept))
            // Numbers that stand for "not given" are not kept.
            && (self.x == i32::MAX || self.x.abs_diff(kept.x) <= PLACE_TOLERANCE.unsigned_abs())
            && (self.y == i32::MAX || self.y.abs_diff(kept.y) <= PLACE_TOLERANCE.unsigned_abs())
            && (self.z - kept.z).abs() <= ALTITUDE_TOLERANCE
            && (!has_place || plain_frame(self.frame) == plain_frame(kept.frame))
    }
}

/// Frames with and without `_INT` are the same.
#[expect(deprecated, reason = "autopilots still say so")]
const fn plain_frame(frame: MavFrame) -> MavFrame {
    match frame {
        MavFrame::MAV_FRAME_GLOBAL_INT => MavFrame::MAV_FRAME_GLOBAL,
        MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT => MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT,
        MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT_INT => MavFrame::MAV_FRAME_GLOBAL_TERRAIN_ALT,
        other => other,
    }
}

/// The index of the first item in which two lists differ; `None` where the autopilot keeps what was sent.
#[must_use]
pub fn first_difference(autopilot: Autopilot, is_mission: bool, sent: &[Item], kept: &[Item]) -> Option<u16> {
    let has_home = is_mission && autopilot == Autopilot::ArduPilot;
    let differs = |index: &usize| match (sent.get(*index), kept.get(*index)) {
        (Some(_), Some(_)) if has_home && *index == 0 => false,
        (Some(sent), Some(kept)) => !sent.is_kept_as(kept),
        _ => true,
    };
    // An autopilot without a mission may keep its home all the same.
    if has_home && sent.is_empty() && kept.len() <= 1 {
        return None;
    }
    (0..sent.len().max(kept.len())).find(differs).map(|index| u16::try_from(index).unwrap_or(u16::MAX))
}

/// A mission as an autopilot takes it.
#[must_use]
pub fn mission_items(autopilot: Autopilot, mission: &Mission) -> Vec<Item> {
    let mut items: Vec<Item> = Vec::new();
    if autopilot == Autopilot::ArduPilot {
        items.push(home(&mission.home));
    }
    let heading = match autopilot {
        Autopilot::ArduPilot => 0.0,
        Autopilot::Px4 => f32::NAN,
    };
    items.extend(mission.items.iter().filter_map(Item::of).map(|mut item| {
        if (item.command as u32) < 100 {
            item.params[3] = heading;
        }
        item
    }));
    items
}

fn home(place: &Place) -> Item {
    let mut home = Item::at(MavCmd::MAV_CMD_NAV_WAYPOINT, [place.latitude_deg, place.longitude_deg], 0.0);
    home.z = place.altitude.meters() as f32;
    home
}

/// Fences as an autopilot takes them: a circle is one item, a polygon one for each corner.
#[must_use]
pub fn fence_items(fences: &[Fence]) -> Vec<Item> {
    let items = |fence: &Fence| match (&fence.outline, fence.side) {
        (FenceOutline::Circle { center, radius_m }, Side::Outside) => {
            vec![Item::at(MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION, *center, *radius_m as f32)]
        }
        (FenceOutline::Circle { center, radius_m }, Side::Inside) => {
            vec![Item::at(MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, *center, *radius_m as f32)]
        }
        (FenceOutline::Polygon(corners), side) => {
            let command = match side {
                Side::Outside => MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION,
                Side::Inside => MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
            };
            corners.iter().map(|corner| Item::at(command, *corner, corners.len() as f32)).collect()
        }
    };
    fences.iter().flat_map(items).collect()
}

/// Rally points as an autopilot takes them: places to return to, at an altitude above home.
#[must_use]
pub fn rally_items(places: &[Place]) -> Vec<Item> {
    let item = |place: &Place| {
        let mut item = Item::at(MavCmd::MAV_CMD_NAV_RALLY_POINT, [place.latitude_deg, place.longitude_deg], 0.0);
        item.frame = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT;
        item.z = place.altitude.meters() as f32;
        item
    };
    places.iter().map(item).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn waypoint() -> Item {
        let mut item = Item::at(MavCmd::MAV_CMD_NAV_WAYPOINT, [47.123_456_7, 8.5], 0.0);
        item.frame = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT;
        item.z = 40.126;
        item
    }

    #[test]
    #[expect(deprecated, reason = "autopilots still say so")]
    fn what_storage_rounds_is_the_same_and_anything_else_is_not() {
        let sent = waypoint();
        let same: [fn(&mut Item); 5] = [
            |item| item.z = 40.12,
            |item| item.x += 1,
            |item| item.params[1] = 0.4,
            |item| item.frame = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT_INT,
            |item| item.autocontinue = false,
        ];
        let other: [fn(&mut Item); 7] = [
            |item| item.z = 40.2,
            |item| item.x += 3,
            |item| item.y -= 100,
            |item| item.params[3] = f32::NAN,
            |item| item.params[0] = 1.0,
            |item| item.frame = MavFrame::MAV_FRAME_GLOBAL,
            |item| item.command = MavCmd::MAV_CMD_NAV_LAND,
        ];
        for (changes, is_same) in [(&same[..], true), (&other[..], false)] {
            for (index, change) in changes.iter().enumerate() {
                let mut kept = sent;
                change(&mut kept);
                assert_eq!(sent.is_kept_as(&kept), is_same, "{index}: {kept:?}");
            }
        }
        let mut speed = Item { command: MavCmd::MAV_CMD_DO_CHANGE_SPEED, params: [1.0, 5.0, -1.0, 0.0], ..sent };
        speed.frame = MavFrame::MAV_FRAME_GLOBAL;
        let kept = Item { frame: MavFrame::MAV_FRAME_MISSION, ..speed };
        assert!(speed.is_kept_as(&kept), "a frame means nothing without a place");
        assert!(!speed.is_kept_as(&Item { params: [1.0, 5.01, -1.0, 0.0], ..speed }), "a speed does");
    }

    #[test]
    fn lists_differ_where_one_is_longer_and_not_in_ardupilots_home() {
        let (item, mut home) = (waypoint(), waypoint());
        home.x = 0;
        let sent = [item, item, item];
        let difference = |autopilot, kept: &[Item]| first_difference(autopilot, true, &sent, kept);
        assert_eq!(difference(Autopilot::Px4, &sent), None);
        assert_eq!(difference(Autopilot::Px4, &sent[..2]), Some(2));
        assert_eq!(difference(Autopilot::Px4, &[item; 4]), Some(3));
        assert_eq!(difference(Autopilot::Px4, &[home, item, item]), Some(0));
        assert_eq!(difference(Autopilot::ArduPilot, &[home, item, item]), None);
        assert_eq!(difference(Autopilot::ArduPilot, &[home, home, item]), Some(1));
        assert_eq!(first_difference(Autopilot::ArduPilot, false, &sent, &[home, item, item]), Some(0), "a fence");
        assert_eq!(first_difference(Autopilot::ArduPilot, true, &[], &[home]), None);
    }
}
