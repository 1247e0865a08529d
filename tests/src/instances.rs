//! Made-up scenarios, drawn at random: what the planner meets that nobody tuned it to.
//!
//! [`instance`] draws one from a seed and an index, as the text of a scenario file, so that whoever reads such files
//! can plan it. The same numbers give the same text.
//!
//! | what | drawn from |
//! |---|---|
//! | dimensions | 2, sometimes 3; domain 10 x 10 (x 3) units of 100 m |
//! | sensors | 5 to 16, TOA or RSS, proxy or energy detectors, path losses of their own; some moving |
//! | objective | detection, false alarm, AEE, CEP, GDOP, mixtures, worst cases, a change of terms on the way |
//! | grid | 40 to 80 intervals; reference point current or lagged |
//! | extras | jamming, dropout, one to three regions, a limit on detection, sometimes two agents |
//!
//! Limits: a limit on detection lies between what start and goal have and what the straight line meets, so that a way
//! around is likely; that one exists is not proven.

use std::fmt::Write as _;

use fastrand::Rng;
use quietpath_bridge::file::ScenarioFile;
use quietpath_bridge::planning::assess;
use quietpath_core::Metric;

use crate::starts;

/// A made-up scenario.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Its name.
    pub name: String,
    /// Its file.
    pub text: String,
    /// What is special about it, for tables by feature.
    pub features: Vec<&'static str>,
}

/// Side of the domain, length units.
const SIDE: f64 = 10.0;
/// Height of the domain in three dimensions, length units.
const HEIGHT: f64 = 3.0;
/// Least distance of a region from start and goal, length units.
const CLEARANCE: f64 = 0.5;
const SPEED_MAX: f64 = 0.1;
const ACCEL_MAX: f64 = 0.02;

/// Draws instance `index` of the sequence that `seed` begins.
///
/// # Panics
/// A drawn scenario is not valid: a mistake in here.
#[must_use]
pub fn instance(seed: u64, index: u64) -> Instance {
    // Neighbouring seeds must not give neighbouring sequences.
    let mut random = Rng::with_seed((seed << 32) ^ index.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let name = format!("random-{seed}-{index}");
    let mut drawing = Drawing { features: Vec::new(), text: String::new(), dimension: 2 };
    drawing.draw(&name, &mut random);
    // Two agents may have the same extra.
    let mut seen = std::collections::BTreeSet::new();
    drawing.features.retain(|feature| seen.insert(*feature));
    let mut instance = Instance { name, text: drawing.text, features: drawing.features };
    if chance(&mut random, 0.12) {
        limit(&mut instance, &mut random);
    }
    instance
}

impl Instance {
    /// The scenario.
    ///
    /// # Panics
    /// It is not valid: a mistake in here.
    #[must_use]
    pub fn scenario(&self) -> ScenarioFile {
        let loaded = ScenarioFile::parse(&self.name, &self.text);
        loaded.unwrap_or_else(|error| panic!("{error}\n{}", self.text)).scenario
    }
}

/// Bounds detection between what the ends have and what the straight line meets.
fn limit(instance: &mut Instance, random: &mut Rng) {
    let scenario = instance.scenario();
    let Ok(found) = assess(&scenario, &starts::straight(&scenario), "the straight line") else { return };
    let Some(series) = found.agents.first().and_then(|agent| agent.metric(Metric::Detection)) else { return };
    let ends = [series.first(), series.last()].into_iter().flatten().copied().fold(0.0, f64::max);
    let peak = series.iter().copied().fold(0.0, f64::max);
    if found.agents.len() == 1 && peak > ends + 0.1 {
        let max = (peak - ends).mul_add(between(random, 0.6, 0.9), ends);
        let _ = writeln!(instance.text, "\n[[limit]]\nmetric = \"detection\"\nmax = {max:.4}");
        instance.features.push("limit");
    }
}

fn chance(random: &mut Rng, share: f64) -> bool {
    random.f64() < share
}

fn between(random: &mut Rng, low: f64, high: f64) -> f64 {
    (high - low).mul_add(random.f64(), low)
}

fn one_of<V: Copy>(random: &mut Rng, list: &[V]) -> V {
    let place = random.usize(..list.len().max(1));
    *list.get(place).expect("a list to choose from is not empty")
}

fn listed(position: &[f64]) -> String {
    let numbers: Vec<String> = position.iter().map(|number| format!("{number:.3}")).collect();
    format!("[{}]", numbers.join(", "))
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// A scenario file in the making.
struct Drawing {
    features: Vec<&'static str>,
    text: String,
    dimension: usize,
}

impl Drawing {
    fn draw(&mut self, name: &str, random: &mut Rng) {
        if chance(random, 0.15) {
            self.dimension = 3;
            self.features.push("3-D");
        }
        let team = if chance(random, 0.1) { 2 } else { 1 };
        if team > 1 {
            self.features.push("team");
        }
        let ends: Vec<[Vec<f64>; 2]> = (0..team).map(|_| self.ends(random)).collect();
        let shortest = ends.iter().map(|[start, goal]| apart(start, goal)).fold(0.0, f64::max) / SPEED_MAX;
        let target = shortest * between(random, 1.05, 1.35);
        let lagged = chance(random, 0.3);
        if lagged {
            self.features.push("lagged");
        }
        let point = if lagged { "lagged" } else { "current" };
        let top = [vec![SIDE, SIDE], vec![HEIGHT]].concat();
        let bottom = vec![0.0; self.dimension];
        let _ = writeln!(
            self.text,
            "name = \"{name}\"\ndimension = {}\nsoftening = 0.05\nreference_point = \"{point}\"\n\n[frame]\n\
             unit_m = 100.0\n\n[grid]\nintervals = {}\n\n[time]\nmax = {:.3}\ntarget = {target:.3}\npenalty = {:.1}\n\n\
             [domain]\nmin = {}\nmax = {}",
            self.dimension,
            random.usize(40..=80),
            2.5 * target,
            one_of(random, &[0.1, 1.0, 1.0, 100.0]),
            listed(&bottom),
            listed(top.get(..self.dimension).unwrap_or_default()),
        );
        let locates = self.objective(target, random);
        for (index, [start, goal]) in ends.iter().enumerate() {
            self.agent(index, [start, goal], target, locates, random);
        }
        self.sensors(target, random);
        if chance(random, 0.35) {
            self.regions(&ends, random);
        }
    }

    fn anywhere(&self, margin: f64, random: &mut Rng) -> Vec<f64> {
        let sides = [SIDE, SIDE, HEIGHT];
        sides.iter().take(self.dimension).map(|side| between(random, margin * side, (1.0 - margin) * side)).collect()
    }

    /// Start and goal, at least six units apart.
    fn ends(&self, random: &mut Rng) -> [Vec<f64>; 2] {
        loop {
            let (start, goal) = (self.anywhere(0.05, random), self.anywhere(0.05, random));
            if apart(&start, &goal) >= 0.6 * SIDE {
                return [start, goal];
            }
        }
    }

    /// Writes the terms; whether one is about location.
    fn objective(&mut self, target: f64, random: &mut Rng) -> bool {
        let location = |random: &mut Rng| one_of(random, &["log_aee", "log_cep2", "log_gdop", "log_cep"]);
        let mut term = |metric: &str, sense: &str, more: &str| {
            let _ = writeln!(self.text, "\n[[objective.term]]\nmetric = \"{metric}\"\nsense = \"{sense}\"{more}");
        };
        match random.u8(..20) {
            0..=6 => {
                term("detection", "min", "");
                false
            }
            7..=11 => {
                term(location(random), "max", "");
                self.features.push("location");
                true
            }
            12..=14 => {
                term("detection", "min", "");
                term(location(random), "max", &format!("\nweight = {:.3}", between(random, 0.05, 0.5)));
                self.features.push("mixed");
                true
            }
            15 | 16 => {
                term("detection", "min", "\nreduce = \"extreme\"\nweight = 100.0");
                term("detection", "min", "\nweight = 0.1");
                self.features.push("worst case");
                false
            }
            17 => {
                term("false_alarm", "max", "");
                term("detection", "min", "");
                self.features.push("false alarm");
                false
            }
            _ => {
                let change = target * between(random, 0.3, 0.7);
                term("detection", "min", &format!("\nuntil = {change:.3}"));
                term(location(random), "max", &format!("\nweight = 0.3\nfrom = {change:.3}"));
                self.features.push("change of terms");
                true
            }
        }
    }

    fn agent(&mut self, index: usize, [start, goal]: [&[f64]; 2], target: f64, locates: bool, random: &mut Rng) {
        let _ = writeln!(
            self.text,
            "\n[[agent]]\nname = \"uav{}\"\nstart = {}\ngoal = {}\nspeed_max = {SPEED_MAX}\naccel_max = {ACCEL_MAX}",
            index + 1,
            listed(start),
            listed(goal)
        );
        if locates && chance(random, 0.25) {
            let pattern = match random.u8(..4) {
                0 => "pattern = \"cosine\"".to_owned(),
                1 => format!("pattern = \"cone\", beam_width = {:.3}", between(random, 1.0, 2.0)),
                _ => "pattern = \"isotropic\"".to_owned(),
            };
            let model = one_of(random, &["none", "linear", "sigmoid", "max"]);
            let budget = target * between(random, 0.1, 0.4);
            let _ =
                writeln!(self.text, "jammer = {{ {pattern}, budget = {budget:.3}, detection_model = \"{model}\" }}");
            self.features.push(if pattern.contains("isotropic") { "jammer" } else { "beam" });
        }
        if chance(random, 0.2) {
            let budget = target * between(random, 0.1, 0.35);
            let _ = writeln!(self.text, "dropout = {{ budget = {budget:.3} }}");
            self.features.push("dropout");
        }
    }

    fn sensors(&mut self, target: f64, random: &mut Rng) {
        let count = random.usize(5..=16);
        let energy = chance(random, 0.3);
        let rss = chance(random, 0.3);
        let moving = if chance(random, 0.3) { random.usize(1..=2) } else { 0 };
        for (is, feature) in [(energy, "energy"), (rss, "RSS"), (moving > 0, "moving")] {
            if is {
                self.features.push(feature);
            }
        }
        let (samples, losses) = (one_of(random, &[20, 51, 100, 400]), [2.0, 2.0, 3.0, 2.5]);
        for sensor in 0..count {
            let place = if sensor < moving {
                let times = [0.0, 0.4 * target, target];
                let knot =
                    |time: &f64| format!("{{ t = {time:.3}, position = {} }}", listed(&self.anywhere(0.05, random)));
                format!("track = [{}]", times.iter().map(knot).collect::<Vec<_>>().join(", "))
            } else {
                format!("position = {}", listed(&self.anywhere(0.02, random)))
            };
            let ranging = if rss {
                let loss = one_of(random, &[0.5, 1.5]);
                format!("model = \"rss\", scale = {:.4}, path_loss = {loss:.1}", between(random, 0.01, 0.05))
            } else {
                let (c1, c2) = (between(random, 0.005, 0.03), between(random, 0.05, 0.3));
                format!("model = \"toa\", c1 = {c1:.4}, c2 = {c2:.4}, path_loss = 2.0")
            };
            let detection = if energy {
                let (signal, threshold) = (between(random, 0.4, 1.0), between(random, 2.0, 4.0));
                format!(
                    "model = \"energy\", samples = {samples}, signal = {signal:.3}, noise = 1.0, \
                     log_threshold = {threshold:.3}, path_loss = 1.0"
                )
            } else {
                let scale = between(random, 0.1, 0.6);
                let loss = one_of(random, &losses);
                format!("model = \"proxy\", scale = {scale:.3}, epsilon = {scale:.3}, path_loss = {loss:.1}")
            };
            let _ = writeln!(
                self.text,
                "\n[[sensor]]\nname = \"s{}\"\n{place}\nranging = {{ {ranging} }}\ndetection = {{ {detection} }}\n\
                 jam = {{ error_gain = {:.2}, error_exponent = 1.0, detect_gain = {:.2}, detect_exponent = 1.0 }}",
                sensor + 1,
                between(random, 5.0, 30.0),
                between(random, 0.2, 1.5),
            );
        }
    }

    /// One to three circles that leave a gap to each other, to start and to goal.
    fn regions(&mut self, ends: &[[Vec<f64>; 2]], random: &mut Rng) {
        let wanted = random.usize(1..=3);
        let mut circles: Vec<([f64; 2], f64)> = Vec::new();
        for _ in 0..50 {
            let (x, y) = (between(random, 0.2, 0.8) * SIDE, between(random, 0.2, 0.8) * SIDE);
            let radius = between(random, 0.6, 1.8);
            let is_clear = |point: &Vec<f64>| apart(&[x, y], point.get(..2).unwrap_or_default()) > radius + CLEARANCE;
            let leaves_gap =
                circles.iter().all(|(center, other)| apart(center, &[x, y]) > radius + other + 2.0 * CLEARANCE);
            if circles.len() < wanted && leaves_gap && ends.iter().flatten().all(is_clear) {
                circles.push(([x, y], radius));
            }
        }
        for (center, radius) in &circles {
            let _ = writeln!(self.text, "\n[[region]]\ncenter = {}\nradius = {radius:.3}", listed(center));
        }
        if !circles.is_empty() {
            self.features.push("region");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_gives_the_same_text_and_another_does_not() {
        assert_eq!(instance(1, 5).text, instance(1, 5).text);
        assert_ne!(instance(1, 5).text.replace("1-5", ""), instance(2, 5).text.replace("2-5", ""));
    }

    #[test]
    fn a_few_hundred_are_valid_and_show_every_feature() {
        let features: std::collections::BTreeSet<_> = (0..300)
            .flat_map(|index| {
                let instance = instance(7, index);
                let scenario = instance.scenario();
                assert!((5..=16).contains(&scenario.sensors.len()) && (40..=80).contains(&scenario.intervals));
                instance.features
            })
            .collect();
        let all = [
            "3-D",
            "team",
            "lagged",
            "location",
            "mixed",
            "worst case",
            "false alarm",
            "change of terms",
            "jammer",
            "beam",
            "dropout",
            "energy",
            "RSS",
            "moving",
            "region",
            "limit",
        ];
        assert_eq!(features, all.into_iter().collect());
    }
}
