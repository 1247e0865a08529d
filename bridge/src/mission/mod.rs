//! Missions on their way to an autopilot and back.
//!
//! | module | what |
//! |---|---|
//! | [`item`] | what a plan is on the wire, for each kind of autopilot; when two lists are the same |
//! | [`pace`] | how long to wait, by the measured round trip |
//! | [`upload`] | one upload |
//! | [`download`] | one download |
//! | [`deliver`] | upload and read-back until the vehicle holds what was sent, or says why not |
//! | [`watch`] | whether somebody else replaced the mission since |
//!
//! All of them are machines without input or output: messages and a time go in, messages come out, and a result
//! stands in the end. Each speaks for one list: mission, fence or rally points, which never mix.

pub mod deliver;
pub mod download;
pub mod item;
pub mod pace;
pub mod upload;
pub mod watch;

use std::fmt;

use crate::link::Identity;
use crate::link::dialect::{MavMissionResult, MavMissionType};

pub use deliver::{Delivered, Delivery};
pub use download::Download;
pub use item::Item;
pub use pace::Pace;
pub use upload::Upload;
pub use watch::Watch;

/// The three lists that an autopilot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum List {
    /// The mission.
    Mission,
    /// The fence.
    Fence,
    /// Rally points.
    Rally,
}

impl List {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Mission, Self::Fence, Self::Rally];

    /// MAVLink's name.
    #[must_use]
    pub const fn mission_type(self) -> MavMissionType {
        match self {
            Self::Mission => MavMissionType::MAV_MISSION_TYPE_MISSION,
            Self::Fence => MavMissionType::MAV_MISSION_TYPE_FENCE,
            Self::Rally => MavMissionType::MAV_MISSION_TYPE_RALLY,
        }
    }
}

impl fmt::Display for List {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Mission => "mission",
            Self::Fence => "fence",
            Self::Rally => "rally points",
        })
    }
}

/// Who talks to whom about which list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Talk {
    /// This end.
    pub us: Identity,
    /// The autopilot.
    pub vehicle: Identity,
    /// The list.
    pub list: List,
}

impl Talk {
    /// Whether a message of the autopilot with these addresses is ours. Others' transfers are overheard, and not ours.
    #[must_use]
    pub fn is_ours(&self, from: Identity, system: u8, component: u8, list: MavMissionType) -> bool {
        from == self.vehicle
            && system == self.us.system
            && (component == self.us.component || component == 0)
            && list == self.list.mission_type()
    }
}

/// Why a transfer failed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Failure {
    /// The autopilot said nothing for longer than we wait.
    Silent,
    /// The autopilot refused the list, while this item was the last one sent.
    Rejected {
        /// Its answer.
        result: MavMissionResult,
        /// Index of the last item sent; `None` before the first.
        item: Option<u16>,
    },
    /// The autopilot gave up, or somebody else began a transfer.
    Cancelled,
    /// The autopilot holds something else than what it accepted.
    Different {
        /// Index of the first item that differs, or of the first that only one of the two has.
        item: u16,
    },
    /// The list does not fit on the wire.
    TooLong,
}

impl Failure {
    /// Whether another try may help.
    #[must_use]
    pub const fn is_passing(self) -> bool {
        matches!(
            self,
            Self::Silent
                | Self::Cancelled
                | Self::Different { .. }
                | Self::Rejected { result: MavMissionResult::MAV_MISSION_ERROR, .. }
        )
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silent => f.write_str("the autopilot does not answer"),
            Self::Rejected { result, item: Some(item) } => {
                write!(f, "the autopilot refuses it with {result:?} at item {item}")
            }
            Self::Rejected { result, item: None } => write!(f, "the autopilot refuses it with {result:?}"),
            Self::Cancelled => f.write_str("the transfer was cancelled by the autopilot"),
            Self::Different { item } => write!(f, "the autopilot holds something else from item {item} on"),
            Self::TooLong => f.write_str("it has more items than a transfer can count"),
        }
    }
}

impl std::error::Error for Failure {}
