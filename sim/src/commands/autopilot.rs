//! `quietpath autopilot`: a simulated autopilot on a link.

use std::io::Write as _;
use std::path::Path;
use std::time::Duration;

use quietpath_bridge::clock::{SystemClock, Time};
use quietpath_bridge::link::memory::Faults;
use quietpath_bridge::link::{Address, Link, Signing};
use quietpath_bridge::telemetry::{Autopilot, Mode};

use super::load;
use crate::autopilot::payload::{Kind, Spec};
use crate::autopilot::serve::{Go, Moment, endpoint, serve};
use crate::autopilot::trouble::Trouble;
use crate::autopilot::{Home, Machine, Pilot, Settings};
use crate::cli::{AutopilotArgs, LikeArg, PilotArg};
use crate::outcome::{Failure, Stream, Verdict, say};

/// Where a vehicle stands that is told nowhere: a model airfield near Zurich.
const SOMEWHERE: Home = Home { latitude_deg: 47.397_742, longitude_deg: 8.545_594, altitude_m: 488.0 };
/// Height that a pilot takes off to where no scenario says another, m.
const HEIGHT: f64 = 30.0;
/// Time between two lines of a track.
const TRACK: Duration = Duration::from_millis(200);

/// Flies until its time is over, or for ever.
///
/// # Errors
/// Bad input; files that cannot be written; no thread for the link.
pub fn run(args: &AutopilotArgs) -> Result<Verdict, Failure> {
    let address: Address = args.connect.parse().map_err(|error| Failure::Input(format!("--connect: {error}")))?;
    let settings = settings(args)?;
    let help = "--speedup is how many times faster than time it flies: a number above 0";
    let clock = SystemClock::at_speed(args.speedup).ok_or_else(|| Failure::Input(help.into()))?;
    let faults = faults(args)?;
    let mut track = args.track.as_deref().map(Track::create).transpose()?;
    let mut machine = Machine::new(settings);
    let mut endpoint = endpoint(&machine);
    if let Some(path) = &args.signing_key {
        let signing = Signing::from_key_file(path, 1, clock.now()).map_err(Failure::input)?;
        endpoint = endpoint.with_signing(signing);
    }
    let mut link = Link::open(address, endpoint, clock).map_err(Failure::input)?;
    let until = args.seconds.map(|seconds| Time::ZERO + seconds);
    let mut last = String::new();
    let mut failed = None;
    let statistics = serve(
        &mut machine,
        &mut link,
        clock,
        (faults, args.seed),
        |_| {},
        |moment| {
            let told = tell(&moment, &mut last).and_then(|()| match &mut track {
                Some(track) => track.write(&moment),
                None => Ok(()),
            });
            let is_over = until.is_some_and(|until| moment.now >= until);
            failed = told.err();
            if is_over || failed.is_some() { Go::Stop } else { Go::On }
        },
    );
    if let Some(failure) = failed {
        return Err(failure);
    }
    let (setpoints, _) = machine.setpoints();
    let summary = format!(
        "{} frames in, {} out, {} of others; {setpoints} setpoints\n",
        statistics.frames_in, statistics.frames_out, statistics.stray
    );
    say(Stream::Out, &summary)?;
    Ok(Verdict::Done)
}

fn settings(args: &AutopilotArgs) -> Result<Settings, Failure> {
    let like = match args.like {
        LikeArg::Px4 => Autopilot::Px4,
        LikeArg::Ardupilot => Autopilot::ArduPilot,
    };
    let mut settings = Settings::new(like, SOMEWHERE);
    let mut height = HEIGHT;
    if let Some(path) = &args.scenario {
        let scenario = load(path)?;
        let agent = args.agent.as_deref();
        settings = Settings::for_agent(like, &scenario, agent).ok_or_else(|| {
            let help = "add latitude_deg, longitude_deg and altitude_m to [frame], and name one of its agents";
            Failure::Input(format!("{path}: does not say where on the Earth this vehicle stands\n  help: {help}"))
        })?;
        height = settings.start_height(&scenario, agent).unwrap_or(HEIGHT);
    }
    if let Some(at) = &args.at {
        settings.home = *at;
    }
    settings.system = args.system;
    settings.pilot = match args.pilot {
        PilotArg::None => Pilot::Nobody,
        PilotArg::Takeoff => Pilot::TakesOff(height),
        PilotArg::Mission => Pilot::StartsMission,
    };
    let spec = |kind| move |component: &u8| Spec { kind, component: *component, instance: 0 };
    settings.payloads.extend(args.transmitter.iter().map(spec(Kind::Transmitter)));
    settings.payloads.extend(args.jammer.iter().map(spec(Kind::Jammer)));
    let at = |seconds: Duration| Time::ZERO + seconds;
    settings.troubles.extend(args.restart_at.iter().map(|seconds| Trouble::Restart { at: at(*seconds) }));
    settings
        .troubles
        .extend(args.silent.iter().map(|window| Trouble::Silence { from: at(window.0), until: at(window.1) }));
    settings.troubles.extend(args.station_at.iter().map(|seconds| Trouble::Station {
        at: at(*seconds),
        items: vec![crate::autopilot::trouble::stay(&settings.home, height); 2],
    }));
    Ok(settings)
}

fn faults(args: &AutopilotArgs) -> Result<Faults, Failure> {
    for (name, share) in [("loss", args.loss), ("duplicate", args.duplicate), ("corrupt", args.corrupt)] {
        if !(0.0..=1.0).contains(&share) {
            return Err(Failure::Input(format!("--{name} {share} is no share: give a number from 0 to 1")));
        }
    }
    let millis = |millis: u64| Duration::from_millis(millis);
    let (loss, duplication, corruption) = (args.loss, args.duplicate, args.corrupt);
    Ok(Faults { loss, duplication, corruption, delay: millis(args.delay), jitter: millis(args.jitter) })
}

/// Says what changed.
fn tell(moment: &Moment<'_>, last: &mut String) -> Result<(), Failure> {
    let machine = moment.machine;
    let state = match (machine.killed(), moment.down) {
        (Some(why), _) => format!("the autopilot's process is gone: {why}"),
        (None, Some(why)) => format!("no link: {why}"),
        (None, None) => {
            let armed = if machine.is_armed() { "armed" } else { "disarmed" };
            let item =
                if machine.mode() == Mode::Mission { format!(", item {}", machine.current()) } else { String::new() };
            format!("{armed}, {:?}, mode {:?}{item}", machine.landed(), machine.mode())
        }
    };
    if state != *last {
        say(Stream::Out, &format!("{:10.2} s  {state}\n", moment.now.seconds()))?;
        *last = state;
    }
    Ok(())
}

/// A file with the track that was flown, as CSV.
struct Track {
    path: std::path::PathBuf,
    file: std::io::BufWriter<std::fs::File>,
    due: Time,
}

impl Track {
    fn create(path: &Path) -> Result<Self, Failure> {
        let fail = |cause| Failure::write(path, &cause);
        let mut file = std::io::BufWriter::new(std::fs::File::create(path).map_err(fail)?);
        writeln!(file, "time_s,latitude_deg,longitude_deg,altitude_m,east_m_s,north_m_s,up_m_s,mode,jam")
            .map_err(fail)?;
        Ok(Self { path: path.to_owned(), file, due: Time::ZERO })
    }

    fn write(&mut self, moment: &Moment<'_>) -> Result<(), Failure> {
        if moment.now < self.due {
            return Ok(());
        }
        self.due = moment.now + TRACK;
        let machine = moment.machine;
        let place = machine.place();
        let [east, north, up] = machine.body().velocity;
        let jammer = machine.settings().payloads.iter().find(|spec| spec.kind == Kind::Jammer);
        let level = jammer.and_then(|spec| machine.payload(spec.component)).map_or(0.0, |payload| payload.level());
        let line = format!(
            "{:.3},{:.8},{:.8},{:.3},{east:.3},{north:.3},{up:.3},{:?},{level}",
            moment.now.seconds(),
            place.latitude_deg,
            place.longitude_deg,
            place.altitude.meters(),
            machine.mode(),
        );
        // A track that is cut off by a signal is read up to where it is.
        writeln!(self.file, "{line}")
            .and_then(|()| self.file.flush())
            .map_err(|cause| Failure::write(&self.path, &cause))
    }
}
