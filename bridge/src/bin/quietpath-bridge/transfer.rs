//! `upload` and `download`.

use std::fmt::Write as _;

use quietpath_bridge::file::mission::missions;
use quietpath_bridge::mission::item::{fence_items, mission_items};
use quietpath_bridge::mission::{Delivery, Download, Failure, Item, List, Pace, Talk};

use crate::Outcome;
use crate::cli::{DownloadArgs, ListArg, UploadArgs};
use crate::config::Config;
use crate::station::Station;

/// Uploads the mission and the fence of a plan, and reads them back.
pub fn upload(args: &UploadArgs) -> Outcome {
    try_upload(args).map_or_else(|outcome| outcome, |()| Outcome::Done)
}

fn try_upload(args: &UploadArgs) -> Result<(), Outcome> {
    let config = Config::read(&args.link)?.with_files(&args.files);
    let (scenario, plan) = config.load()?;
    plan.fits("the plan", &scenario).map_err(|error| Outcome::Input(error.to_string()))?;
    let all = missions(&scenario, &plan).map_err(|error| Outcome::Input(error.to_string()))?;
    let wanted = config.flight.agent.clone();
    let mission = all.into_iter().find(|mission| wanted.as_ref().is_none_or(|name| *name == mission.agent));
    let mission = mission.ok_or_else(|| Outcome::Input("the plan has no such agent".into()))?;
    let mut station = Station::find(&config)?;
    let items = mission_items(station.vehicle.autopilot, &mission);
    let mut lists = vec![(List::Mission, items)];
    // Without regions there is nothing to say: a fence that somebody else has set stays.
    if config.flight.fence && !mission.fences.is_empty() {
        lists.push((List::Fence, fence_items(&mission.fences)));
    }
    for (list, items) in lists {
        let (us, vehicle) = (station.link.endpoint().identity(), station.vehicle);
        let talk = Talk { us, vehicle: vehicle.identity, list };
        let mut delivery = Delivery::new(talk, vehicle.autopilot, items, Pace::default());
        station.work(|now, frame, out| {
            match frame {
                Some(frame) => delivery.handle(now, frame, out),
                None => delivery.poll(now, out),
            }
            delivery.result().is_some()
        });
        match delivery.result() {
            Some(Ok(delivered)) => println!("the autopilot holds the {list}: {} items, read back", delivered.count),
            Some(Err(failure)) => return Err(Outcome::Failed(format!("the {list} was not delivered: {failure}"))),
            None => {}
        }
    }
    Ok(())
}

/// Writes a list that the autopilot holds.
pub fn download(args: &DownloadArgs) -> Outcome {
    let list = match args.list {
        ListArg::Mission => List::Mission,
        ListArg::Fence => List::Fence,
        ListArg::Rally => List::Rally,
    };
    let found = Config::read(&args.link).and_then(|config| Station::find(&config));
    let mut station = match found {
        Ok(station) => station,
        Err(outcome) => return outcome,
    };
    let talk = Talk { us: station.link.endpoint().identity(), vehicle: station.vehicle.identity, list };
    let mut download = Download::new(talk, Pace::default());
    station.work(|now, frame, out| {
        match frame {
            Some(frame) => download.handle(now, frame, out),
            None => download.poll(now, out),
        }
        download.result().is_some()
    });
    let text = match download.result() {
        Some(Ok(items)) => waypoints(items),
        Some(Err(failure)) => return failed(list, failure),
        None => return failed(list, Failure::Silent),
    };
    match &args.out {
        None => print!("{text}"),
        Some(path) => {
            if let Err(error) = std::fs::write(path, text) {
                return Outcome::Input(format!("{}: cannot be written: {error}", path.display()));
            }
        }
    }
    Outcome::Done
}

fn failed(list: List, failure: Failure) -> Outcome {
    Outcome::Failed(format!("the {list} was not read: {failure}"))
}

/// Items as a `QGC WPL 110` file.
fn waypoints(items: &[Item]) -> String {
    let mut out = String::from("QGC WPL 110\n");
    for (index, item) in items.iter().enumerate() {
        let [p1, p2, p3, p4] = item.params;
        let (x, y) = (f64::from(item.x) * 1e-7, f64::from(item.y) * 1e-7);
        let (current, goes_on) = (u8::from(index == 0), u8::from(item.autocontinue));
        let (frame, command) = (item.frame as u32, item.command as u32);
        let _ = writeln!(
            out,
            "{index}\t{current}\t{frame}\t{command}\t{p1}\t{p2}\t{p3}\t{p4}\t{x:.8}\t{y:.8}\t{:.3}\t{goes_on}",
            item.z
        );
    }
    out
}
