//! The gallery: every figure of section 4 of the paper, and what the program does beyond them, planned and drawn anew.
//!
//! `cargo xtask gallery` runs this from the top of the repository. It writes `docs/gallery.md` and `docs/gallery/*.png`; all
//! numbers on the page are figures of the plans that are drawn. Scenarios that only the gallery has stand beside this file.

mod wall;

use std::error::Error;
use std::fmt::Write as _;
use std::fs;

use quietpath_core::horizon::Cadence;
use quietpath_core::scenario::Metric;
use quietpath_sim::trade::{Amount, Over};

use wall::Wall;

type Outcome<T> = Result<T, Box<dyn Error>>;

/// What a figure is made of.
enum Plate {
    /// Landscapes of metrics, each of a scenario.
    Landscapes(&'static [(&'static str, Metric)]),
    /// Plans in one piece, over the metric that they optimise.
    Plans(&'static [&'static str]),
    /// Plans in one piece with all their figures over time.
    Flights(&'static [&'static str]),
    /// A sweep.
    Sweep(&'static str, Over, &'static [Amount]),
    /// A flight in steps, of a cadence of its own or as the scenario says, and the steps that are shown each on its own.
    Steps(&'static str, Option<Cadence<f64>>, &'static [usize]),
    /// The same detectors each for itself, pooled, and pooled with correlated signals.
    Pools(&'static str),
}

/// A figure of the page.
struct Figure {
    /// Where the paper has it; empty where it does not.
    number: &'static str,
    title: &'static str,
    text: &'static str,
    plate: Plate,
}

const FIGURES: &[Figure] = &[
    Figure {
        number: "Fig. 2",
        title: "Landscapes",
        text: "Six metrics over the same eight sensors: probability of detection by proxy and by energy detector, \
               probability of false alarms, and the logarithms of CEP, AEE and GDOP. Yellow is high, blue is low.",
        plate: Plate::Landscapes(&[
            ("square8-detection", Metric::Detection),
            ("square8-energy", Metric::Detection),
            ("square8-false-alarm", Metric::FalseAlarm),
            ("square8-cep", Metric::LogCep),
            ("square8-aee", Metric::LogAee),
            ("square8-gdop", Metric::LogGdop),
        ]),
    },
    Figure {
        number: "Fig. 3",
        title: "One objective each",
        text: "Least probability of detection keeps away from sensors; largest CEP, AEE and GDOP hug them.",
        plate: Plate::Plans(&["square8-detection", "square8-cep", "square8-aee", "square8-gdop"]),
    },
    Figure {
        number: "Fig. 4",
        title: "Deadlines",
        text: "Target times of 100, 105, 110 and 115 % of the shortest flight time: with more time, less detection.",
        plate: Plate::Sweep(
            "square8-deadline-105",
            Over::Deadline,
            &[Amount::Share(1.0), Amount::Share(1.05), Amount::Share(1.1), Amount::Share(1.15)],
        ),
    },
    Figure {
        number: "Fig. 5 (one agent)",
        title: "Jamming",
        text: "The largest location error with more and more jamming: levels, dashed, are highest where the error is low.",
        plate: Plate::Sweep(
            "square8-jam",
            Over::JamBudget,
            &[Amount::Seconds(0.0), Amount::Seconds(15.0), Amount::Seconds(30.0), Amount::Seconds(60.0)],
        ),
    },
    Figure {
        number: "Fig. 5 (two agents)",
        title: "A helper that jams",
        text: "Two agents start together; the second jams for both.",
        plate: Plate::Flights(&["square8-team"]),
    },
    Figure {
        number: "Fig. 6",
        title: "Intermittent communication",
        text: "Dropout budgets of 0, 17 and 35 % of the flight. Silent stretches have a white core.",
        plate: Plate::Sweep(
            "dropout4-35",
            Over::DropoutBudget,
            &[Amount::Share(0.0), Amount::Share(0.17), Amount::Share(0.35)],
        ),
    },
    Figure {
        number: "Fig. 7",
        title: "The Isle of Wight",
        text: "Sensors, one of them moving, and forbidden circles: AEE and probability of detection at the start.",
        plate: Plate::Landscapes(&[("wight", Metric::LogAee), ("wight", Metric::Detection)]),
    },
    Figure {
        number: "Figs. 8 and 9",
        title: "Isle of Wight without jamming",
        text: "Flown in 18 steps. A step knows where sensor 9 is, and takes it to stay there. Solid is flown, dashed is \
               planned; the landscape is that of the time of the step.",
        plate: Plate::Steps("wight", None, &[1, 6, 9, 13]),
    },
    Figure {
        number: "Figs. 10 and 11",
        title: "Isle of Wight with jamming",
        text: "The same with a jammer, whose use is in the last diagram.",
        plate: Plate::Steps("wight-jam", None, &[1, 6, 9, 13]),
    },
    Figure {
        number: "",
        title: "The same in one piece",
        text: "Planned once, with every track known: what steps that do not know the future can be held against.",
        plate: Plate::Plans(&["wight", "wight-jam"]),
    },
    Figure {
        number: "",
        title: "Steps that follow the change that is seen",
        text: "Remark 3.3.1 of the paper: steps shorten while the metric along the plan changes, and grow while it rests.",
        plate: Plate::Steps("wight", Some(Cadence::Adaptive { shortest: 2, longest: 16, change: 0.05 }), &[]),
    },
    Figure {
        number: "",
        title: "Regions",
        text: "Equation (60), with convex polygons: one to stay in, two to keep out of. Whole segments keep clear, so that no \
               corner is cut.",
        plate: Plate::Plans(&["corridor"]),
    },
    Figure {
        number: "",
        title: "Limits",
        text: "Equations (61) and (62): the location error may be anything, as long as detection stays below its limit.",
        plate: Plate::Flights(&["square8-limit"]),
    },
    Figure {
        number: "",
        title: "Beams",
        text: "Section 3.1.2: a jammer with one beam, whose direction is planned with the path.",
        plate: Plate::Flights(&["square8-beam"]),
    },
    Figure {
        number: "",
        title: "Keeping apart",
        text: "Two agents pass each other between two sensors, at least 100 m from each other all the time.",
        plate: Plate::Plans(&["apart"]),
    },
    Figure {
        number: "",
        title: "Sensors that pool their signals",
        text: "Section 2.3.2: energy detectors that decide each for itself, together with uncorrelated signals, and together \
               with correlated ones.",
        plate: Plate::Pools("pooled"),
    },
    Figure {
        number: "",
        title: "Many agents, and three dimensions",
        text: "Four agents, two of which jam, among thirty-two sensors; and a flight whose height is planned as well, over the \
               landscape at the height of its start.",
        plate: Plate::Plans(&["swarm4", "volume8-detection"]),
    },
];

fn main() -> Outcome<()> {
    let mut page = String::from(
        "# Gallery\n\nEvery figure of section 4 of the paper, and what this program plans beyond them. `cargo xtask gallery` \
         makes this page\nand its pictures anew: no number on it is typed by hand.\n",
    );
    fs::create_dir_all("docs/gallery")?;
    for (index, figure) in FIGURES.iter().enumerate() {
        println!("{}", figure.title);
        let source =
            if figure.number.is_empty() { String::new() } else { format!("{} of the paper. ", figure.number) };
        let _ = write!(page, "\n## {}\n\n{source}{}\n\n", figure.title, figure.text);
        Wall::new(&mut page, index + 1).hang(&figure.plate)?;
    }
    fs::write("docs/gallery.md", page)?;
    Ok(())
}
