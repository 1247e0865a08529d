//! Whether the autopilot still holds our mission, and whether we are alone.
//!
//! A sign that somebody else sent one is looked into by reading the mission back; only a mission that differs ends the
//! flight.

use crate::clock::Time;
use crate::link::Frame;
use crate::link::dialect::MavMessage;
use crate::mission::item::first_difference;
use crate::mission::{Download, Item, List, Watch};
use crate::telemetry::{Mode, Vehicle};

use super::settings::FlyMode;
use super::{End, Flight, Level, OTHER_LIVES, Phase};

/// Others on this vehicle: programs that speak as this one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Company {
    /// When the vehicle was met.
    pub(super) met: Time,
    /// When another one was heard first.
    heard: Option<Time>,
    /// Whether people were told.
    is_told: bool,
}

impl Flight {
    /// From now on this mission is ours.
    pub(super) fn watch_over(&mut self, watch: Watch, kept: Vec<Item>) {
        (self.watch, self.kept, self.check) = (Some(watch), kept, None);
    }

    pub(super) fn watch_mission(&mut self, frame: &Frame) {
        // Our own transfer looks like somebody else's while it goes on.
        if self.update.is_some() {
            return;
        }
        let mut out = Vec::new();
        if let Some(check) = &mut self.check {
            check.handle(self.now, frame, &mut out);
        }
        self.send(out);
        if !self.watch.as_mut().is_some_and(|watch| watch.handle(frame)) || self.check.is_some() {
            return;
        }
        let Some(vehicle) = self.telemetry.vehicle().copied() else { return };
        self.say(Level::Warn, "the mission may have been replaced: reading it back");
        self.check = Some(Download::new(self.talk(vehicle.identity, List::Mission), self.pace()));
    }

    pub(super) fn advance_check(&mut self, vehicle: &Vehicle) {
        let Some(check) = &mut self.check else { return };
        let mut out = Vec::<MavMessage>::new();
        check.poll(self.now, &mut out);
        let verdict = check
            .result()
            .map(|kept| kept.map(|kept| first_difference(vehicle.autopilot, true, &self.kept, kept).is_none()));
        self.send(out);
        match verdict {
            None => {}
            Some(Ok(false)) => self.lose_mission(),
            Some(Ok(true)) => {
                self.check = None;
                if let Some(watch) = &mut self.watch {
                    watch.confirm();
                }
            }
            // Silence proves nothing: the next sign asks again.
            Some(Err(_)) => self.check = None,
        }
    }

    /// Another program on this vehicle says that it is this component. One that flies goes on; one that does not yet
    /// does not begin. Twice: the last word of a bridge that has died may come late.
    pub(super) fn meet_another(&mut self) {
        let Some(first) = self.company.heard else { return self.company.heard = Some(self.now) };
        if self.now.since(first) < OTHER_LIVES {
            return;
        }
        let who = format!("another program speaks as component {} of this vehicle", self.us.component);
        match self.phase {
            Phase::Connect | Phase::PickUp { .. } | Phase::Deliver { .. } | Phase::Ready => {
                self.end(End::Failed(format!("{who}: end it first")));
            }
            Phase::Approach { .. } => self.leave(Mode::Hold, End::Failed(format!("{who}: end it first"))),
            Phase::Fly if !self.company.is_told => {
                self.company.is_told = true;
                self.say(Level::Warn, who);
            }
            Phase::Fly | Phase::Leave { .. } | Phase::Ended => {}
        }
    }

    fn lose_mission(&mut self) {
        (self.watch, self.check) = (None, None);
        if matches!(self.phase, Phase::Fly | Phase::Ready) && self.settings.mode == FlyMode::Mission {
            self.end(End::Released("another station replaced the mission".into()));
        }
    }
}
