//! Reads `data/model_golden.txt`: scenarios, plans, and the figures that an independent reading of the model has
//! for them.
use quietpath_core::error::Error;
use quietpath_core::scenario::*;
use quietpath_core::{Draft, Metric, Point, Scenario, Trajectory};

/// Room for every made-up scenario.
pub type Stored<T, const DIM: usize> = Scenario<T, DIM, 8, 3, 16>;
pub type Plan<T, const DIM: usize> = Trajectory<T, DIM, 9, 3>;

/// A scenario as lists that a test can change before it validates them.
#[derive(Clone, Debug)]
pub struct Made<const DIM: usize> {
    pub name: String,
    pub softening: f64,
    pub reference_point: ReferencePoint,
    pub pooling: Pooling<f64>,
    pub intervals: usize,
    pub time: Timing<f64>,
    pub domain: Domain<f64, DIM>,
    pub agents: Vec<Agent<f64, DIM>>,
    pub sensors: Vec<MadeSensor<DIM>>,
    pub terms: Vec<Term<f64>>,
    pub regions: Vec<Region<f64>>,
    pub limits: Vec<Limit<f64>>,
    pub plans: Vec<Golden<DIM>>,
}

#[derive(Clone, Debug)]
pub struct MadeSensor<const DIM: usize> {
    pub position: Option<Point<f64, DIM>>,
    pub knots: Vec<Knot<f64, DIM>>,
    pub ranging: Option<Ranging<f64>>,
    pub detection: Option<Detection<f64>>,
    pub jam: Susceptibility<f64>,
}

/// A plan and its figures.
#[derive(Clone, Debug)]
pub struct Golden<const DIM: usize> {
    pub plan: Plan<f64, DIM>,
    /// Agent, node, and the metrics in the order of `Metric::ALL`.
    pub values: Vec<(usize, usize, Vec<Option<f64>>)>,
    pub objective: f64,
    pub violations: Vec<(String, f64)>,
}

impl<const DIM: usize> Made<DIM> {
    /// Validates the scenario, in double precision.
    pub fn stored(&self) -> Result<Stored<f64, DIM>, Error> {
        let motion = |sensor: &MadeSensor<DIM>| (sensor.position, sensor.knots.clone());
        let motions: Vec<_> = self.sensors.iter().map(motion).collect();
        let sensors: Vec<_> = self
            .sensors
            .iter()
            .zip(&motions)
            .map(|(sensor, (position, knots))| Sensor {
                motion: position.map_or(Motion::Track(knots), Motion::Fixed),
                ranging: sensor.ranging,
                detection: sensor.detection,
                jam: sensor.jam,
            })
            .collect();
        Scenario::new(&Draft {
            softening: self.softening,
            reference_point: self.reference_point,
            pooling: self.pooling,
            intervals: self.intervals,
            start_time: 0.0,
            time: self.time,
            domain: self.domain,
            agents: &self.agents,
            sensors: &sensors,
            terms: &self.terms,
            separation: None,
            regions: &self.regions,
            limits: &self.limits,
        })
    }
}

/// The words of one line, taken one after the other.
struct Words<'a>(std::str::SplitWhitespace<'a>);

impl<'a> Words<'a> {
    fn word(&mut self) -> &'a str {
        self.0.next().expect("a word more")
    }
    fn number(&mut self) -> f64 {
        self.word().parse().expect("a number")
    }
    fn count(&mut self) -> usize {
        self.word().parse().expect("a whole number")
    }
    fn option(&mut self) -> Option<f64> {
        let word = self.word();
        (word != "none").then(|| word.parse().expect("a number"))
    }
    fn point<const DIM: usize>(&mut self) -> Point<f64, DIM> {
        Point::from_fn(|_, _| self.number())
    }
    fn window(&mut self) -> Window<f64> {
        Window { from: self.number(), until: self.number() }
    }
    fn metric(&mut self) -> Metric {
        let name = self.word();
        Metric::ALL.into_iter().find(|metric| metric.name() == name).expect("a metric")
    }
}

/// All scenarios of the given dimension.
pub fn scenarios<const DIM: usize>() -> Vec<Made<DIM>> {
    let text = include_str!("../data/model_golden.txt");
    let mut all: Vec<Made<DIM>> = Vec::new();
    let mut wanted = false;
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut words = Words(line.split_whitespace());
        let key = words.word();
        if key == "scenario" {
            let name = words.word();
            wanted = words.count() == DIM;
            if wanted {
                all.push(scenario(name, &mut words));
            }
        } else if wanted {
            entry(all.last_mut().expect("a scenario first"), key, &mut words);
        }
    }
    all
}

fn scenario<const DIM: usize>(name: &str, words: &mut Words<'_>) -> Made<DIM> {
    Made {
        name: name.into(),
        softening: words.number(),
        reference_point: match words.word() {
            "lagged" => ReferencePoint::Lagged,
            _ => ReferencePoint::Current,
        },
        pooling: Pooling::None,
        intervals: words.count(),
        time: Timing { max: words.number(), target: words.number(), penalty: words.number() },
        domain: Domain { min: words.point(), max: words.point() },
        agents: Vec::new(),
        sensors: Vec::new(),
        terms: Vec::new(),
        regions: Vec::new(),
        limits: Vec::new(),
        plans: Vec::new(),
    }
}

fn entry<const DIM: usize>(made: &mut Made<DIM>, key: &str, words: &mut Words<'_>) {
    match key {
        "agent" => made.agents.push(agent(words)),
        "jammer" => made.agents.last_mut().expect("made-up data is whole").jammer = Some(jammer(words)),
        "dropout" => {
            made.agents.last_mut().expect("made-up data is whole").dropout = Some(Dropout { budget: words.number() })
        }
        "term" => made.terms.push(Term {
            metric: words.metric(),
            sense: if words.word() == "max" { Sense::Maximize } else { Sense::Minimize },
            reduce: if words.word() == "extreme" { Reduce::Extreme } else { Reduce::Integral },
            weight: words.number(),
            agents: AgentSet(u32::try_from(words.count()).expect("made-up data is whole")),
            window: words.window(),
        }),
        "region" => {
            let (center, radius) = (words.point(), words.number());
            let shape = Shape::Circle { center, radius };
            made.regions.push(Region { shape, side: Side::Outside, window: words.window() });
        }
        "limit" => {
            made.limits.push(Limit { metric: words.metric(), min: words.option(), max: words.option() });
        }
        "plan" | "node" | "objective" | "violation" => golden(made, key, words),
        _ => sensor(&mut made.sensors, key, words),
    }
}

fn agent<const DIM: usize>(words: &mut Words<'_>) -> Agent<f64, DIM> {
    let (start, goal) = (words.point(), words.point());
    let (speed_max, accel_max, weight) = (words.number(), words.number(), words.number());
    let start_velocity =
        words.option().map(|first| Point::from_fn(|index, _| if index == 0 { first } else { words.number() }));
    Agent { start, goal, start_velocity, speed_max, accel_max, weight, jammer: None, dropout: None }
}

fn jammer(words: &mut Words<'_>) -> Jammer<f64> {
    let pattern = words.word();
    let beam_width = words.option();
    let betrayal = words.word();
    let q = words.option();
    Jammer {
        pattern: match pattern {
            "cosine" => BeamPattern::Cosine,
            "cone" => BeamPattern::Cone { beam_width: beam_width.expect("made-up data is whole") },
            _ => BeamPattern::Isotropic,
        },
        betrayal: match betrayal {
            "max" => Betrayal::Max { q: q.unwrap_or(15.0) },
            "linear" => Betrayal::Linear,
            "sigmoid" => Betrayal::Sigmoid,
            _ => Betrayal::None,
        },
        budget: words.number(),
    }
}

fn sensor<const DIM: usize>(sensors: &mut Vec<MadeSensor<DIM>>, key: &str, words: &mut Words<'_>) {
    if key == "sensor" {
        let jam = Susceptibility {
            error_gain: words.number(),
            error_exponent: words.number(),
            detect_gain: words.number(),
            detect_exponent: words.number(),
        };
        sensors.push(MadeSensor { position: None, knots: Vec::new(), ranging: None, detection: None, jam });
        return;
    }
    let sensor = sensors.last_mut().expect("made-up data is whole");
    match key {
        "position" => sensor.position = Some(words.point()),
        "knot" => sensor.knots.push(Knot { time: words.number(), position: words.point() }),
        "rss" => sensor.ranging = Some(Ranging::Rss { scale: words.number(), path_loss: words.number() }),
        "toa" => {
            let (c1, c2) = (words.number(), words.number());
            sensor.ranging = Some(Ranging::Toa { c1, c2, path_loss: words.number() });
        }
        "proxy" => {
            let (scale, epsilon) = (words.number(), words.number());
            sensor.detection = Some(Detection::Proxy { scale, epsilon, path_loss: words.number() });
        }
        "energy" => {
            sensor.detection = Some(Detection::Energy {
                samples: u32::try_from(words.count()).expect("made-up data is whole"),
                signal: words.number(),
                noise: words.number(),
                log_threshold: words.number(),
                path_loss: words.number(),
            });
        }
        other => panic!("what is {other}?"),
    }
}

fn golden<const DIM: usize>(made: &mut Made<DIM>, key: &str, words: &mut Words<'_>) {
    if key == "plan" {
        let mut plan = Plan::zeros(made.intervals, made.agents.len()).expect("made-up data is whole");
        for node in 0..=made.intervals {
            plan.times[node] = words.number();
        }
        made.plans.push(Golden { plan, values: Vec::new(), objective: 0.0, violations: Vec::new() });
        return;
    }
    let intervals = made.intervals;
    let golden = made.plans.last_mut().expect("made-up data is whole");
    match key {
        "node" => {
            let agent = words.count();
            let node = golden.values.len() % (intervals + 1);
            let track = &mut golden.plan.tracks[agent];
            track.path[node] = words.point();
            track.jam[node] = words.number();
            track.azimuth[node] = words.number();
            track.dropout[node] = words.number();
            golden.values.push((agent, node, Metric::ALL.iter().map(|_| words.option()).collect()));
        }
        "objective" => golden.objective = words.number(),
        _ => golden.violations.push((words.word().into(), words.number())),
    }
}
