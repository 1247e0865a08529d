//! Delivery: upload and read back until the autopilot holds what was sent, or says why not.
//!
//! An ACK is a promise, and may be lost or belong to somebody else's transfer. What counts is what the autopilot sends
//! back, so every upload is read back and compared ([`super::item::first_difference`]). A try that failed for a passing
//! reason is followed by another, [`TRIES_MAX`] in all; a refusal is final.

use crate::clock::Time;
use crate::link::Frame;
use crate::link::dialect::MavMessage;
use crate::telemetry::Autopilot;

use super::item::first_difference;
use super::upload::Accepted;
use super::{Download, Failure, Item, List, Pace, Talk, Upload};

/// Uploads before giving up.
pub const TRIES_MAX: u32 = 5;

/// A list that the autopilot holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delivered {
    /// Number of items, home among them.
    pub count: u16,
    /// The id that the autopilot gave the list, 0 where it gives none.
    pub opaque_id: u32,
}

#[derive(Clone, Debug)]
enum Step {
    Upload(Upload),
    ReadBack(Download),
}

/// A delivery. See the [module](self).
#[derive(Clone, Debug)]
pub struct Delivery {
    talk: Talk,
    autopilot: Autopilot,
    items: Vec<Item>,
    step: Step,
    tries: u32,
    is_accepted: bool,
    result: Option<Result<Delivered, Failure>>,
}

impl Delivery {
    /// A delivery of a list; [`Delivery::poll`] begins it.
    #[must_use]
    pub fn new(talk: Talk, autopilot: Autopilot, items: Vec<Item>, pace: Pace) -> Self {
        let step = Step::Upload(Upload::new(talk, items.clone(), pace));
        Self { talk, autopilot, items, step, tries: 1, is_accepted: false, result: None }
    }

    /// How it ended; `None` while it goes on.
    #[must_use]
    pub const fn result(&self) -> Option<Result<Delivered, Failure>> {
        self.result
    }

    /// Whether the autopilot said that it took the list, or holds one as long after it asked for all of it, which is not proved
    /// yet. Its ACK may be lost, and a vehicle in flight is not to wait for the proof.
    #[must_use]
    pub const fn is_accepted(&self) -> bool {
        self.is_accepted
    }

    /// The list.
    #[must_use]
    pub const fn list(&self) -> List {
        self.talk.list
    }

    /// What is delivered.
    #[must_use]
    pub fn items(&self) -> &[Item] {
        &self.items
    }

    /// Uploads so far.
    #[must_use]
    pub const fn tries(&self) -> u32 {
        self.tries
    }

    /// Takes a message of the link.
    pub fn handle(&mut self, now: Time, frame: &Frame, out: &mut Vec<MavMessage>) {
        match &mut self.step {
            Step::Upload(upload) => upload.handle(now, frame, out),
            Step::ReadBack(download) => download.handle(now, frame, out),
        }
        self.advance(now, out);
    }

    /// Sends what is due.
    pub fn poll(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        if self.result.is_some() {
            return;
        }
        match &mut self.step {
            Step::Upload(upload) => upload.poll(now, out),
            Step::ReadBack(download) => download.poll(now, out),
        }
        self.advance(now, out);
    }

    fn advance(&mut self, now: Time, out: &mut Vec<MavMessage>) {
        if self.result.is_some() {
            return;
        }
        match &self.step {
            Step::Upload(upload) => match upload.result() {
                None => {}
                Some(Ok(accepted)) => {
                    self.is_accepted = matches!(accepted, Accepted::Yes { .. });
                    let mut download = Download::new(self.talk, upload.pace());
                    download.poll(now, out);
                    self.step = Step::ReadBack(download);
                }
                Some(Err(failure)) => {
                    out.push(upload.cancel());
                    self.again(upload.pace(), failure);
                }
            },
            Step::ReadBack(download) => match download.result() {
                None => {
                    let is_as_long = download.count().is_some_and(|count| usize::from(count) == self.items.len());
                    self.is_accepted |= is_as_long;
                }
                Some(Ok(kept)) => {
                    let is_mission = self.talk.list == List::Mission;
                    match first_difference(self.autopilot, is_mission, &self.items, kept) {
                        None => {
                            let count = u16::try_from(kept.len()).unwrap_or(u16::MAX);
                            let opaque_id = download.opaque_id();
                            self.result = Some(Ok(Delivered { count, opaque_id }));
                        }
                        Some(item) => self.again(download.pace(), Failure::Different { item }),
                    }
                }
                Some(Err(failure)) => self.again(download.pace(), failure),
            },
        }
    }

    /// Begins anew after a passing failure; ends after a final one.
    fn again(&mut self, pace: Pace, failure: Failure) {
        if !failure.is_passing() || self.tries >= TRIES_MAX {
            self.result = Some(Err(failure));
            return;
        }
        (self.tries, self.is_accepted) = (self.tries + 1, false);
        self.step = Step::Upload(Upload::new(self.talk, self.items.clone(), pace));
    }
}
