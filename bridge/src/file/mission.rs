//! Missions: a plan as waypoints for autopilots, in the two formats that ground stations open.
//!
//! A mission is, per agent: home, take-off at the start, then every node of the path as a waypoint, with a speed
//! command before each leg whose speed differs from the last one commanded. It ends at the goal, where autopilots
//! hold their position; landing is the operator's decision. Waypoints carry no times: an autopilot flies the legs
//! at the speeds given, slows down in turns, and arrives somewhat later than planned. Flying on time needs the
//! vehicle to be steered live.
//!
//! | file | format |
//! |---|---|
//! | `mission.plan` | QGroundControl JSON, with regions as fences |
//! | `mission.waypoints` | `QGC WPL 110`, item 0 home |
//!
//! Altitudes count as [`crate::frame`] says: two dimensions are flown relative to home (frame 3), three above
//! mean sea level (frame 0). Unused numbers are 0, because ArduPilot rejects NaN; the yaw of the JSON is `null`, which
//! ground stations translate for the autopilot at hand. Jamming and dropout have no portable mission item and are
//! left out. Item 0 of a waypoint file is home by the format's own rule; a program that does not know the rule flies
//! there first (MAVSDK's importer does): give PX4 the JSON.
//!
//! Regions are fences: circles and polygons, exclusions where they are kept out of, inclusions where they are
//! stayed in. A region that applies for part of the time only is left out of the fence, which knows no time.

use std::fmt::Write as _;

use quietpath_core::scenario::Side;
use serde_json::{Value, json};

use super::scenario::{Outline, RegionEntry};
use super::{FileError, PlanFile, ScenarioFile};
use crate::frame::{Altitude, LocalFrame, Place};

/// `MAV_CMD_NAV_WAYPOINT`.
const WAYPOINT: u16 = 16;
/// `MAV_CMD_NAV_TAKEOFF`.
const TAKEOFF: u16 = 22;
/// `MAV_CMD_DO_CHANGE_SPEED`.
const CHANGE_SPEED: u16 = 178;
/// `MAV_FRAME_GLOBAL`: altitude above mean sea level.
const FRAME_SEA_LEVEL: u8 = 0;
/// `MAV_FRAME_GLOBAL_RELATIVE_ALT`: altitude above home.
const FRAME_HOME: u8 = 3;
/// Change of speed that is worth a command, as a share of the speed.
const SPEED_STEP: f64 = 0.02;
/// Items that every autopilot has room for; `ArduPilot` takes 650.
const ITEMS_MAX: usize = 650;

/// One mission item.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// MAVLink command.
    pub command: u16,
    /// MAVLink frame of the altitude.
    pub frame: u8,
    /// Parameters 1 to 4.
    pub params: [f64; 4],
    /// Latitude, degrees; 0 where there is none.
    pub latitude_deg: f64,
    /// Longitude, degrees; 0 where there is none.
    pub longitude_deg: f64,
    /// Altitude, m, as `frame` says.
    pub altitude_m: f64,
}

/// The mission of one agent.
#[derive(Clone, Debug, PartialEq)]
pub struct Mission {
    /// Name of the agent.
    pub agent: String,
    /// Home: the scenario's origin.
    pub home: Place,
    /// Items without home, in order.
    pub items: Vec<Item>,
    /// Largest speed of a leg, m/s.
    pub speed_max_m_s: f64,
    /// Fences: the regions that apply all the time.
    pub fences: Vec<Fence>,
}

/// A region on the Earth.
#[derive(Clone, Debug, PartialEq)]
pub struct Fence {
    /// Which side the vehicle stays on.
    pub side: Side,
    /// Its outline.
    pub outline: FenceOutline,
}

/// The outline of a fence.
#[derive(Clone, Debug, PartialEq)]
pub enum FenceOutline {
    /// A circle.
    Circle {
        /// Latitude and longitude of the centre, degrees.
        center: [f64; 2],
        /// Radius, m.
        radius_m: f64,
    },
    /// A polygon: latitudes and longitudes of its corners, counter-clockwise, degrees.
    Polygon(Vec<[f64; 2]>),
}

/// The missions of all agents, in order.
///
/// # Errors
/// The scenario has no latitude and longitude; a mission has more items than autopilots take.
pub fn missions(scenario: &ScenarioFile, plan: &PlanFile) -> Result<Vec<Mission>, Box<FileError>> {
    let frame = located(scenario)?;
    let times = plan.node_times();
    let fences: Vec<Fence> = (scenario.regions.iter())
        .filter(|region| region.window.from <= scenario.start_time && region.window.until >= scenario.time.max)
        .map(|region| fence(&frame, region))
        .collect();
    let mission = |agent: &super::plan::AgentPlan| {
        let (items, speed_max_m_s) = items(&frame, &agent.path, &times);
        if items.len() >= ITEMS_MAX {
            let message = format!("makes a mission of {} items with home", items.len() + 1);
            let help = format!("autopilots take {ITEMS_MAX}: plan with fewer intervals to fly it as a mission");
            return Err(Box::new(FileError::whole(scenario.file_name(), message, help)));
        }
        let (agent, home, fences) = (agent.name.clone(), frame.home(), fences.clone());
        Ok(Mission { agent, home, items, speed_max_m_s, fences })
    };
    plan.agents.iter().map(mission).collect()
}

fn fence(frame: &LocalFrame, region: &RegionEntry) -> Fence {
    let place = |[east, north]: [f64; 2]| {
        let (latitude, longitude) = frame.latitude_longitude(east, north);
        [latitude, longitude]
    };
    let outline = match &region.outline {
        Outline::Circle { center, radius } => {
            FenceOutline::Circle { center: place(*center), radius_m: radius * frame.unit_m() }
        }
        polygon @ Outline::Polygon(_) => FenceOutline::Polygon(polygon.ring(0).into_iter().map(place).collect()),
    };
    Fence { side: region.side, outline }
}

/// The frame of a scenario that lies on the Earth.
pub(super) fn located(scenario: &ScenarioFile) -> Result<LocalFrame, Box<FileError>> {
    LocalFrame::of(scenario).ok_or_else(|| {
        let help = "add latitude_deg, longitude_deg and altitude_m to [frame]";
        let message = "does not say where on the Earth it lies, and so has no mission";
        Box::new(FileError::whole(scenario.file_name(), message, help))
    })
}

/// Take-off, waypoints and speeds; and the largest speed, m/s.
fn items(frame: &LocalFrame, path: &[Vec<f64>], times: &[f64]) -> (Vec<Item>, f64) {
    let mut items = Vec::new();
    let (mut commanded, mut largest) = (0.0_f64, 0.0_f64);
    let mut before: Option<(&Vec<f64>, f64)> = None;
    for (position, time) in path.iter().zip(times) {
        match before {
            None => items.push(navigate(TAKEOFF, &frame.place(position))),
            Some((from, earlier)) => {
                let squares = from.iter().zip(position).map(|(a, b)| (b - a).powi(2));
                let speed = squares.sum::<f64>().sqrt() * frame.unit_m() / (time - earlier);
                largest = largest.max(speed);
                // An autopilot cannot be told to fly at no speed: a pause is flown as a slow leg.
                if speed > 0.0 && (speed - commanded).abs() > SPEED_STEP * speed {
                    items.push(change_speed(speed));
                    commanded = speed;
                }
            }
        }
        items.push(navigate(WAYPOINT, &frame.place(position)));
        before = Some((position, *time));
    }
    (items, largest)
}

fn navigate(command: u16, place: &Place) -> Item {
    let (frame, altitude_m) = match place.altitude {
        Altitude::AboveHome(meters) => (FRAME_HOME, meters),
        Altitude::AboveSeaLevel(meters) => (FRAME_SEA_LEVEL, meters),
    };
    let (latitude_deg, longitude_deg) = (place.latitude_deg, place.longitude_deg);
    Item { command, frame, params: [0.0; 4], latitude_deg, longitude_deg, altitude_m }
}

/// Ground speed, m/s; throttle unchanged.
fn change_speed(speed_m_s: f64) -> Item {
    let params = [1.0, rounded(speed_m_s, 1e3), -1.0, 0.0];
    let (command, frame) = (CHANGE_SPEED, FRAME_SEA_LEVEL);
    Item { command, frame, params, latitude_deg: 0.0, longitude_deg: 0.0, altitude_m: 0.0 }
}

fn rounded(value: f64, per_unit: f64) -> f64 {
    (value * per_unit).round() / per_unit
}

impl Mission {
    /// The `QGroundControl` plan.
    #[must_use]
    pub fn to_qgc_plan(&self) -> String {
        let items: Vec<Value> =
            self.items.iter().enumerate().map(|(index, item)| qgc_item(index + 1, item)).collect();
        let (mut circles, mut polygons) = (Vec::new(), Vec::new());
        for Fence { side, outline } in &self.fences {
            let inclusion = *side == Side::Inside;
            match outline {
                FenceOutline::Circle { center, radius_m } => circles.push(json!({
                    "circle": { "center": center, "radius": radius_m },
                    "inclusion": inclusion,
                    "version": 1,
                })),
                FenceOutline::Polygon(corners) => {
                    polygons.push(json!({ "polygon": corners, "inclusion": inclusion, "version": 1 }));
                }
            }
        }
        // The scenario does not know how high home lies; an autopilot takes its own home when it is armed.
        let home_altitude = match self.home.altitude {
            Altitude::AboveHome(_) => 0.0,
            Altitude::AboveSeaLevel(meters) => meters,
        };
        let plan = json!({
            "fileType": "Plan",
            "groundStation": "quietpath",
            "version": 1,
            "mission": {
                "version": 2,
                "firmwareType": 0,
                "vehicleType": 2,
                "cruiseSpeed": rounded(self.speed_max_m_s, 1e3),
                "hoverSpeed": rounded(self.speed_max_m_s, 1e3),
                "globalPlanAltitudeMode": self.altitude_mode(),
                "plannedHomePosition": [self.home.latitude_deg, self.home.longitude_deg, home_altitude],
                "items": items,
            },
            "geoFence": { "version": 2, "circles": circles, "polygons": polygons },
            "rallyPoints": { "version": 2, "points": [] },
        });
        format!("{plan:#}\n")
    }

    /// QGroundControl's altitude mode: 1 relative to home, 2 above mean sea level.
    fn altitude_mode(&self) -> u8 {
        match self.home.altitude {
            Altitude::AboveHome(_) => 1,
            Altitude::AboveSeaLevel(_) => 2,
        }
    }

    /// The `QGC WPL 110` file.
    #[must_use]
    pub fn to_waypoints(&self) -> String {
        let mut out = String::from("QGC WPL 110\n");
        let home = Item { frame: FRAME_SEA_LEVEL, ..navigate(WAYPOINT, &self.home) };
        for (index, item) in std::iter::once(&home).chain(&self.items).enumerate() {
            let [p1, p2, p3, p4] = item.params;
            let current = u8::from(index == 0);
            let _ = writeln!(
                out,
                "{index}\t{current}\t{}\t{}\t{p1}\t{p2}\t{p3}\t{p4}\t{:.8}\t{:.8}\t{:.3}\t1",
                item.frame, item.command, item.latitude_deg, item.longitude_deg, item.altitude_m
            );
        }
        out
    }
}

/// An item of `QGroundControl`'s JSON.
fn qgc_item(number: usize, item: &Item) -> Value {
    let [p1, p2, p3, p4] = item.params;
    let mut value = json!({
        "type": "SimpleItem",
        "autoContinue": true,
        "command": item.command,
        "doJumpId": number,
        "frame": item.frame,
        "params": [p1, p2, p3, p4, item.latitude_deg, item.longitude_deg, item.altitude_m],
    });
    if item.command != CHANGE_SPEED {
        value["params"][3] = Value::Null;
        value["Altitude"] = json!(item.altitude_m);
        value["AltitudeMode"] = json!(if item.frame == FRAME_HOME { 1 } else { 2 });
        value["AMSLAltAboveTerrain"] = Value::Null;
    }
    value
}

/// The name of an agent's mission file: `mission.plan` where there is one agent, `mission-uav1.plan` otherwise.
#[must_use]
pub fn file_name(agent: &str, agents: usize, extension: &str) -> String {
    if agents == 1 {
        return format!("mission.{extension}");
    }
    let safe = |c: char| if c.is_alphanumeric() || matches!(c, '-' | '_' | '.') { c } else { '_' };
    format!("mission-{}.{extension}", agent.chars().map(safe).collect::<String>())
}
