//! Trade-offs: plans of one scenario over a range of deadlines, jamming budgets or dropout budgets.
//!
//! | what is swept | field that it sets | plain numbers are | `%` is of |
//! |---|---|---|---|
//! | `deadline` | `time.target`, t_F of (29) | multiples of t_M | t_M |
//! | `jam-budget` | `jammer.budget` of every jammer, (49) | seconds at full level | the flight's time |
//! | `dropout-budget` | `dropout.budget` of every agent with dropout, (55) | seconds of silence | the flight's time |
//!
//! t_M is the shortest flight time, straight at full speed (section 4.4). The flight's time is `time.target` where
//! lateness is penalised, and `time.max` otherwise, both from the start time.
//!
//! More time or a larger budget never makes the best plan worse, so no point of a sweep may be worse than the one
//! before it: see [`sweep()`] for how that is kept.
//!
//! Limits: scenarios with `[rolling]` are planned in one piece; [`POINTS_MAX`].

mod draw;
mod record;
mod sweep;

pub use draw::{Drawn, draw};
pub use record::{to_csv, to_json};
pub use sweep::{Point, Swept, sweep};

use std::str::FromStr;

use quietpath_bridge::file::{FileError, ScenarioFile};

/// Points of a sweep.
pub const POINTS_MAX: usize = 64;

/// What is swept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Over {
    /// Latest arrival that is not penalised; plain numbers are multiples of the shortest flight time
    Deadline,
    /// Seconds of jamming at full level, of every agent that jams
    JamBudget,
    /// Seconds of silence, of every agent that may fall silent
    DropoutBudget,
}

impl Over {
    /// The name that the command line uses.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Deadline => "deadline",
            Self::JamBudget => "jam-budget",
            Self::DropoutBudget => "dropout-budget",
        }
    }

    /// The name for people.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Deadline => "deadline",
            Self::JamBudget => "jamming budget",
            Self::DropoutBudget => "dropout budget",
        }
    }

    /// What its percentages are of.
    #[must_use]
    pub const fn whole(self) -> &'static str {
        match self {
            Self::Deadline => "the shortest flight time",
            Self::JamBudget | Self::DropoutBudget => "the flight's time",
        }
    }
}

/// A value of what is swept, as the command line writes it: `1.05`, `105%`, `100.6s`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Amount {
    /// A plain number: multiples of the shortest flight time for a deadline, seconds for a budget.
    Plain(f64),
    /// A part of 1, written in percent.
    Share(f64),
    /// Seconds.
    Seconds(f64),
}

impl FromStr for Amount {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let number = |text: &str| match text.trim().parse::<f64>() {
            Ok(value) if value.is_finite() && value >= 0.0 => Ok(value),
            _ => Err("give a number of at least 0 such as 1.05, 105% or 100.6s".to_owned()),
        };
        if let Some(percent) = text.strip_suffix('%') {
            return number(percent).map(|value| Self::Share(value / 100.0));
        }
        match text.strip_suffix('s') {
            Some(seconds) => number(seconds).map(Self::Seconds),
            None => number(text).map(Self::Plain),
        }
    }
}

/// Which values.
#[derive(Clone, Debug, PartialEq)]
pub enum Range {
    /// Evenly spaced, ends included; an end that is not given is the usual one.
    Even {
        /// First.
        from: Option<Amount>,
        /// Last.
        to: Option<Amount>,
        /// How many.
        points: usize,
    },
    /// One by one.
    Listed(Vec<Amount>),
}

/// A scenario with one value of what is swept.
#[derive(Clone, Debug, PartialEq)]
pub struct Case {
    /// The value, s.
    pub seconds: f64,
    /// The value as a part of [`Over::whole`].
    pub share: f64,
    /// The scenario that has it.
    pub scenario: ScenarioFile,
}

impl Case {
    /// The value for people.
    #[must_use]
    pub fn label(&self, over: Over) -> String {
        let percent = crate::picture::scale::trimmed((1000.0 * self.share).round() / 10.0);
        let seconds = crate::picture::scale::trimmed((100.0 * self.seconds).round() / 100.0);
        match over {
            Over::Deadline => format!("{percent} %"),
            Over::JamBudget | Over::DropoutBudget => format!("{seconds} s ({percent} %)"),
        }
    }
}

/// The cases of a sweep in ascending order, each value once.
///
/// # Errors
/// What cannot be swept in this scenario, by field; values out of range.
pub fn cases(scenario: &ScenarioFile, over: Over, range: &Range) -> Result<Vec<Case>, Box<FileError>> {
    let whole = whole(scenario, over)?;
    let seconds = |amount: &Amount| match (amount, over) {
        (Amount::Share(share), _) => share * whole,
        (Amount::Plain(multiple), Over::Deadline) => multiple * whole,
        (Amount::Plain(seconds) | Amount::Seconds(seconds), _) => *seconds,
    };
    let mut values: Vec<f64> = match range {
        Range::Listed(amounts) => amounts.iter().map(seconds).collect(),
        Range::Even { from, to, points } => {
            let usual = usual(scenario, over, whole);
            let from = from.as_ref().map_or(usual[0], seconds);
            let to = to.as_ref().map_or(usual[1], seconds);
            if to <= from {
                let message = format!("--to must be more than --from, which is {from} s, and is {to} s");
                let help = "give --to, or list the values with --values";
                return Err(Box::new(FileError::whole(scenario.file_name(), message, help)));
            }
            let last = points.saturating_sub(1).max(1) as f64;
            (0..*points).map(|point| from + (to - from) * point as f64 / last).collect()
        }
    };
    values.sort_by(f64::total_cmp);
    values.dedup_by(|b, a| (*b - *a).abs() <= 1e-12 * a.abs());
    values.into_iter().map(|value| case(scenario, over, value, whole)).collect()
}

fn case(scenario: &ScenarioFile, over: Over, seconds: f64, whole: f64) -> Result<Case, Box<FileError>> {
    let mut changed = scenario.clone();
    match over {
        Over::Deadline => {
            let shortest = whole * (1.0 - 1e-9);
            let allowed = scenario.time.max - scenario.start_time;
            if seconds < shortest || seconds > allowed {
                let message = format!("cannot have a deadline of {seconds} s");
                let help = format!("the shortest flight takes {whole} s, and `time.max` leaves {allowed} s");
                return Err(Box::new(FileError::whole(scenario.file_name(), message, help)));
            }
            changed.time.target = scenario.start_time + seconds;
        }
        Over::JamBudget => {
            changed.agents.iter_mut().filter_map(|agent| agent.jammer.as_mut()).for_each(|it| it.budget = seconds);
        }
        Over::DropoutBudget => {
            changed.agents.iter_mut().filter_map(|agent| agent.dropout.as_mut()).for_each(|it| it.budget = seconds);
        }
    }
    Ok(Case { seconds, share: seconds / whole, scenario: changed })
}

/// The time that percentages are of, s, once it is clear that there is something to sweep.
fn whole(scenario: &ScenarioFile, over: Over) -> Result<f64, Box<FileError>> {
    let allowed = scenario.time.max - scenario.start_time;
    let target = scenario.time.target - scenario.start_time;
    let flight = if scenario.time.penalty > 0.0 && target > 0.0 { target.min(allowed) } else { allowed };
    let first = if scenario.agents.len() == 1 { "agent[0]" } else { "agent" };
    match over {
        Over::Deadline if scenario.time.penalty > 0.0 => Ok(shortest(scenario)),
        Over::Deadline => {
            let help = "give it, in objective units per s^2, such as `penalty = 100.0` under [time]";
            Err(scenario.error_at("time.penalty", "is 0, so that no deadline makes a difference", help))
        }
        Over::JamBudget if scenario.agents.iter().any(|agent| agent.jammer.is_some()) => Ok(flight),
        Over::JamBudget => {
            let help = "give an agent `jammer = { pattern = \"isotropic\", budget = 30.0 }`";
            Err(scenario.error_at(
                &format!("{first}.jammer"),
                "is missing, so that there is no budget to sweep",
                help,
            ))
        }
        Over::DropoutBudget if scenario.agents.iter().any(|agent| agent.dropout.is_some()) => Ok(flight),
        Over::DropoutBudget => {
            let help = "give an agent `dropout = { budget = 20.0 }`";
            Err(scenario.error_at(
                &format!("{first}.dropout"),
                "is missing, so that there is no budget to sweep",
                help,
            ))
        }
    }
}

/// Shortest flight time t_M: every agent straight to its goal at full speed, s.
fn shortest(scenario: &ScenarioFile) -> f64 {
    let time = |agent: &quietpath_bridge::file::scenario::AgentEntry| {
        let legs = agent.start.iter().zip(&agent.goal).map(|(from, to)| (to - from) * (to - from));
        legs.sum::<f64>().sqrt() / agent.speed_max
    };
    scenario.agents.iter().map(time).fold(0.0, f64::max)
}

/// First and last value where none are given, s.
fn usual(scenario: &ScenarioFile, over: Over, whole: f64) -> [f64; 2] {
    let most = |budgets: &mut dyn Iterator<Item = f64>| budgets.fold(0.0, f64::max);
    match over {
        Over::Deadline => [whole, (1.3 * whole).min(scenario.time.max - scenario.start_time)],
        Over::JamBudget => [0.0, most(&mut scenario.agents.iter().filter_map(|it| it.jammer).map(|it| it.budget))],
        Over::DropoutBudget => {
            [0.0, most(&mut scenario.agents.iter().filter_map(|it| it.dropout).map(|it| it.budget))]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario(text: &str) -> ScenarioFile {
        ScenarioFile::parse("s.toml", text).expect("a scenario").scenario
    }

    fn jam() -> ScenarioFile {
        scenario(include_str!("../../scenarios/square8-jam.toml"))
    }

    #[test]
    fn amounts_have_units() {
        assert_eq!("1.05".parse(), Ok(Amount::Plain(1.05)));
        assert_eq!("105%".parse(), Ok(Amount::Share(1.05)));
        assert_eq!("100.6s".parse(), Ok(Amount::Seconds(100.6)));
        for wrong in ["", "-1", "nan", "inf", "5 %%", "ten", "s"] {
            let parsed: Result<Amount, _> = wrong.parse();
            assert!(parsed.is_err(), "{wrong}");
        }
    }

    #[test]
    fn values_are_seconds_in_ascending_order() {
        let listed = Range::Listed(vec![Amount::Share(0.5), Amount::Plain(10.0), Amount::Seconds(10.0)]);
        let found = cases(&jam(), Over::JamBudget, &listed).expect("cases");
        let budgets: Vec<f64> = found.iter().map(|case| case.seconds).collect();
        assert_eq!(budgets, [10.0, 0.5 * 105.382_067]);
        assert_eq!(found[0].scenario.agents[0].jammer.map(|jammer| jammer.budget), Some(10.0));
        let even = Range::Even { from: None, to: Some(Amount::Share(1.2)), points: 3 };
        let found = cases(&jam(), Over::Deadline, &even).expect("cases");
        let shares: Vec<f64> = found.iter().map(|case| (case.share * 1e6).round() / 1e6).collect();
        assert_eq!(shares, [1.0, 1.1, 1.2]);
        assert!((found[0].scenario.time.target - 7.7_f64.hypot(5.7) / 0.1).abs() < 1e-9);
    }

    #[test]
    fn what_cannot_be_swept_is_refused_by_field() {
        let quiet = scenario(include_str!("../../scenarios/square8-deadline-105.toml"));
        let says = |over, amount| {
            let range = Range::Listed(vec![amount]);
            cases(&quiet, over, &range).expect_err("refused").to_string()
        };
        assert!(says(Over::JamBudget, Amount::Plain(1.0)).contains("agent[0].jammer is missing"));
        assert!(says(Over::DropoutBudget, Amount::Plain(1.0)).contains("agent[0].dropout is missing"));
        assert!(says(Over::Deadline, Amount::Plain(0.9)).contains("cannot have a deadline"));
        let mut soft = quiet.clone();
        soft.time.penalty = 0.0;
        let error = cases(&soft, Over::Deadline, &Range::Listed(vec![Amount::Plain(1.1)])).expect_err("refused");
        assert!(error.to_string().contains("time.penalty is 0"), "{error}");
        let crossed = Range::Even { from: Some(Amount::Plain(1.2)), to: Some(Amount::Plain(1.1)), points: 3 };
        let error = cases(&quiet, Over::Deadline, &crossed).expect_err("refused");
        assert!(error.to_string().contains("--to must be more than --from"), "{error}");
    }
}
