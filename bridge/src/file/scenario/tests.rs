//! Every kind of bad input, by message, line and remedy.

use quietpath_core::constraints::Constraint;

use super::*;

const GOOD: &str = r#"name = "small"
dimension = 2
softening = 0.05
[grid]
intervals = 60
[time]
max = 300.0
[domain]
min = [0.0, 0.0]
max = [10.0, 10.0]
[[agent]]
name = "uav1"
start = [0.8, 1.0]
goal = [8.5, 6.7]
speed_max = 0.1
accel_max = 0.02
[[sensor]]
position = [2.0, 2.0]
ranging = { model = "toa", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }
detection = { model = "proxy", scale = 0.3, epsilon = 0.3, path_loss = 2.0 }
[[sensor]]
track = [{ t = 0.0, position = [5.0, 1.5] }, { t = 9.0, position = [5.0, 2.5] }]
ranging = { model = "rss", scale = 0.01, path_loss = 2.0 }
[[sensor]]
position = [8.0, 2.0]
ranging = { model = "toa", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }
[[objective.term]]
metric = "log_aee"
sense = "max"
agents = ["uav1"]
"#;

/// What to replace in [`GOOD`], by what, and what the error must say in order.
type Case = (&'static str, &'static str, &'static [&'static str]);

const CASES: &[Case] = &[
    (
        "0.1\naccel",
        "-1\naccel",
        &[
            "small.toml:15: agent[0].speed_max must be greater than 0, not -1\n  15 | speed_max = -1\n  help: give a number greater than 0, in length units per second",
        ],
    ),
    (
        "0.1\naccel",
        "nan\naccel",
        &["small.toml:15: agent[0].speed_max is not a finite number\n  15 | ", "help: write a number"],
    ),
    ("0.1\naccel", "inf\naccel", &["small.toml:15: agent[0].speed_max is not a finite number"]),
    ("0.1\naccel", "1e999\naccel", &["small.toml:15: agent[0].speed_max is not a finite number"]),
    (
        "0.1\naccel",
        "\"fast\"\naccel",
        &["small.toml:15: agent[0].speed_max must be a number, not text", "without quotes"],
    ),
    ("[2.0, 2.0]", "[2.0, nan]", &["small.toml:18: sensor[0].position[1] is not a finite number"]),
    (
        "[0.8, 1.0]",
        "[0.8, 11.0]",
        &[
            "small.toml:13: agent[0].start lies outside the domain\n  13 | ",
            "help: its north coordinate 11 must lie between 0 and 10",
        ],
    ),
    (
        "[8.5, 6.7]",
        "[-8.5, 6.7]",
        &["small.toml:14: agent[0].goal lies outside the domain", "its east coordinate -8.5 must lie"],
    ),
    ("[0.8, 1.0]", "[0.8, 1.0, 2.0]", &["small.toml:13: agent[0].start must have 2 numbers, not 3", "[east, north]"]),
    ("[0.8, 1.0]", "7", &["small.toml:13: agent[0].start must be a list, not a whole number"]),
    (
        "max = 300.0",
        "max = 30.0",
        &[
            "small.toml:14: agent[0].goal cannot be reached: the straight line at full speed takes 95.80",
            "help: `time.max = 95.8019` would do",
        ],
    ),
    (
        "speed_max",
        "sped_max",
        &[
            "small.toml:15: agent[0].sped_max is not a known key",
            "did you mean `speed_max`? keys here are `name`, `start`",
        ],
    ),
    ("softening", "softning", &["small.toml:3: softning is not a known key", "did you mean `softening`?"]),
    ("softening", "zzz", &["small.toml:3: zzz is not a known key", "help: keys here are"]),
    (
        "c1 = 0.01, c2 = 0.1, path_loss = 2.0 }\ndet",
        "c1 = 0.01, c3 = 0.1, path_loss = 2.0 }\ndet",
        &["small.toml:19: sensor[0].ranging.c3 is not a known key", "did you mean `c2`?"],
    ),
    (
        "c1 = 0.01, c2 = 0.1, path_loss = 2.0 }\ndet",
        "c1 = 0.01, path_loss = 2.0 }\ndet",
        &["small.toml:19: sensor[0].ranging.c2 is missing", "add `c2 = "],
    ),
    (
        "accel_max = 0.02\n",
        "",
        &["small.toml:11: agent[0].accel_max is missing\n  11 | [[agent]]\n  help: add `accel_max = 1.0`"],
    ),
    ("[grid]\nintervals = 60\n", "", &["small.toml:1: grid is missing", "[grid] with `intervals = 60`"]),
    (
        "intervals = 60",
        "intervals = 513",
        &["small.toml:5: grid.intervals is 513, and this build has room for 512 intervals"],
    ),
    ("intervals = 60", "intervals = 0", &["small.toml:5: grid.intervals must be greater than 0, not 0"]),
    ("intervals = 60", "intervals = -3", &["small.toml:5: grid.intervals must not be negative, but is -3"]),
    ("intervals = 60", "intervals = 6.5", &["small.toml:5: grid.intervals must be a whole number, not a number"]),
    ("dimension = 2", "dimension = 4", &["small.toml:2: dimension must be 2 or 3, not 4"]),
    (
        "t = 9.0",
        "t = 0.0",
        &["small.toml:22: sensor[1].track[1].t must be later than the time of entry 0", "0 s follows 0 s"],
    ),
    ("t = 9.0", "time = 9.0", &["small.toml:22: sensor[1].track[1].time is not a known key"]),
    (
        "[[sensor]]\nposition = [8.0, 2.0]\nranging = { model = \"toa\", c1 = 0.01, c2 = 0.1, path_loss = 2.0 }\n",
        "",
        &[
            "small.toml:25: objective.term[0].metric needs at least 3 sensors with `ranging`, and there are 2",
            "help: give at least 3 sensors",
        ],
    ),
    ("position = [8.0, 2.0]\n", "", &["small.toml:24: sensor[2].position is missing", "or `track ="]),
    (
        "position = [8.0, 2.0]\n",
        "position = [8.0, 2.0]\ntrack = []\n",
        &["small.toml:26: sensor[2].track must not stand beside `position`"],
    ),
    ("position = [8.0, 2.0]\n", "track = []\n", &["small.toml:25: sensor[2].track needs at least one entry"]),
    (
        "[[objective.term]]\nmetric = \"log_aee\"\nsense = \"max\"\nagents = [\"uav1\"]\n",
        "",
        &["small.toml: objective.term needs at least one entry", "add [[objective.term]]"],
    ),
    (
        "[[objective.term]]\nmetric = \"log_aee\"\nsense = \"max\"\nagents = [\"uav1\"]\n",
        "[objective]\nterm = []\n",
        &["small.toml:28: objective.term needs at least one entry"],
    ),
    (
        "[[objective.term]]",
        "[objective.term]",
        &["small.toml:27: objective.term must be a list of tables", "[[objective.term]] with two brackets"],
    ),
    (
        "log_aee",
        "log_eae",
        &[
            "small.toml:28: objective.term[0].metric must not be `log_eae`",
            "did you mean `log_aee`? it can be `detection`, ",
        ],
    ),
    ("metric = \"log_aee\"\n", "", &["small.toml:27: objective.term[0].metric is missing", "one of `detection`"]),
    (
        "\"max\"",
        "\"biggest\"",
        &["small.toml:29: objective.term[0].sense must not be `biggest`", "it can be `min` or `max`"],
    ),
    (
        "[\"uav1\"]",
        "[\"uav2\"]",
        &[
            "small.toml:30: objective.term[0].agents[0] names `uav2`, and there is no such agent",
            "did you mean `uav1`?",
        ],
    ),
    ("[\"uav1\"]", "[]", &["small.toml:30: objective.term[0].agents needs at least one entry"]),
    ("\"rss\"", "\"rsss\"", &["small.toml:23: sensor[1].ranging.model must not be `rsss`", "did you mean `rss`?"]),
    (
        "min = [0.0, 0.0]",
        "min = [10.0, 0.0]",
        &["small.toml:9: domain.min has a lower bound that is not below its upper bound"],
    ),
    ("[grid]", "[grid", &["small.toml:4: is not valid TOML: "]),
    ("max = 300.0", "max = 300.0\nmax = 300.0", &["small.toml:8: is not valid TOML: duplicate key"]),
    ("max = 300.0", "max = 300.0\npenalty = -1", &["small.toml:8: time.penalty must not be negative, but is -1"]),
    (
        "[[objective",
        "[[region]]\ncenter = [5, 5]\nradius = 0.0\n[[objective",
        &["small.toml:29: region[0].radius must be greater than 0, not 0"],
    ),
    (
        "[[objective",
        "[[region]]\nradius = 1.0\n[[objective",
        &["small.toml:27: region[0].center is missing", "or `polygon = "],
    ),
    (
        "[[objective",
        "[[region]]\npolygon = [[1, 4], [2, 4], [1, 5]]\nradius = 1.0\n[[objective",
        &["small.toml:29: region[0].radius must not stand beside `polygon`", "keep `polygon`, or "],
    ),
    (
        "[[objective",
        "[[region]]\npolygon = [[1, 4], [2, 4]]\n[[objective",
        &["small.toml:28: region[0].polygon has 2 entries, and needs at least 3", "at least 3 corners"],
    ),
    (
        "[[objective",
        "[[region]]\npolygon = [[1, 4], [2, 4], [1, 5, 6]]\n[[objective",
        &["small.toml:28: region[0].polygon[2] must have 2 numbers, not 3", "[east, north]"],
    ),
    (
        "[[objective",
        "[[region]]\npolygon = [\n[1, 4],\n[5, 4],\n[2, 5],\n[1, 9]]\n[[objective",
        &["small.toml:31: region[0].polygon[2] is a corner at which the polygon is not strictly convex", "a dent"],
    ),
    (
        "[[objective",
        "[[region]]\npolygon = [[1, 4], [2, 4], [1, 5]]\ninside = 1\n[[objective",
        &["small.toml:29: region[0].inside must be true or false, not a whole number"],
    ),
    (
        "[[objective",
        "[[region]]\nname = \"port\"\npolygon = [[0, 0], [2, 0], [0, 3]]\n[[objective",
        &[
            "small.toml:13: agent[0].start lies inside region[0] (port), which is to be kept out of",
            "`from` or `until`",
        ],
    ),
    (
        "[[objective",
        "[[region]]\ninside = true\ncenter = [1, 1]\nradius = 2\n[[objective",
        &["small.toml:14: agent[0].goal lies outside region[0] (region1), which is to be stayed in"],
    ),
    ("dimension = 2", "dimension = 2\nseparation = 0.0", &["small.toml:3: separation must be greater than 0, not 0"]),
    (
        "[[objective",
        "[[limit]]\nmetric = \"detection\"\n[[objective",
        &["small.toml:27: limit[0].max is missing", "`min`, `max` or both"],
    ),
    ("[[objective", "[rolling]\nsteps = 0\n[[objective", &["small.toml:28: rolling.steps must be greater than 0"]),
    (
        "[[objective",
        "[rolling]\nsteps = 61\n[[objective",
        &[
            "small.toml:28: rolling.steps must lie between 1 and 60, but is 61\n  28 | steps = 61",
            "the flight has 60 intervals",
        ],
    ),
    (
        "[[objective",
        "[rolling]\nreveal = \"known\"\n[[objective",
        &["small.toml:27: rolling.steps is missing", "help: add `steps = 18`, or `adaptive = {"],
    ),
    (
        "[[objective",
        "[rolling]\nsteps = 6\nreveal = \"all\"\n[[objective",
        &["small.toml:29: rolling.reveal must not be `all`", "it can be `current`, `predicted`"],
    ),
    (
        "[[objective",
        "[rolling]\nsteps = 6\nadaptive = { shortest = 1, longest = 9, change = 0.1 }\n[[objective",
        &["small.toml:29: rolling.adaptive must not stand beside `steps`"],
    ),
    (
        "[[objective",
        "[rolling]\nadaptive = { shortest = 4, longest = 2, change = 0.1 }\n[[objective",
        &["small.toml:28: rolling.adaptive.longest must lie between 4 and 60, but is 2"],
    ),
    (
        "[[objective",
        "[rolling]\nadaptive = { shortest = 4, change = 0.1 }\n[[objective",
        &["small.toml:28: rolling.adaptive.longest is missing", "add `longest = 10`"],
    ),
    (
        "[[objective",
        "[rolling]\nadaptive = { shortest = 1, longest = 9, change = 0 }\n[[objective",
        &["small.toml:28: rolling.adaptive.change must be greater than 0, not 0"],
    ),
    (
        "[[sensor]]\nposition = [2.0",
        "[[agent]]\nname = \"uav1\"\nstart = [1, 1]\ngoal = [2, 2]\nspeed_max = 1\naccel_max = 1\n[[sensor]]\nposition = [2.0",
        &["small.toml:18: agent[1].name is `uav1`, the name of agent[0] already"],
    ),
    (
        "[grid]",
        "[frame]\nlatitude_deg = 95.0\n[grid]",
        &["small.toml:5: frame.latitude_deg must lie between -90 and 90, but is 95"],
    ),
    (
        "[grid]",
        "[pooling]\nlog_threshold = 1.0\n[grid]",
        &["small.toml:4: pooling.model is missing", "`uncorrelated`"],
    ),
    (
        "[grid]",
        "[pooling]\nmodel = \"corelated\"\nlog_threshold = 1.0\n[grid]",
        &["small.toml:5: pooling.model must not be `corelated`", "did you mean `correlated`?"],
    ),
    (
        "[grid]",
        "[pooling]\nmodel = \"uncorrelated\"\n[grid]",
        &["small.toml:4: pooling.log_threshold is missing", "add `log_threshold = "],
    ),
    (
        "[grid]",
        "[pooling]\nmodel = \"uncorrelated\"\nlog_threshold = 1.0\ncorrelation = 0.5\n[grid]",
        &["small.toml:7: pooling.correlation is not a known key"],
    ),
    (
        "[grid]",
        "[pooling]\nmodel = \"correlated\"\nlog_threshold = nan\ncorrelation = 0.5\n[grid]",
        &["small.toml:6: pooling.log_threshold is not a finite number"],
    ),
    (
        "[grid]",
        "[pooling]\nmodel = \"correlated\"\nlog_threshold = 1.0\ncorrelation = 1.5\n[grid]",
        &["small.toml:7: pooling.correlation must lie between 0 and 1, but is 1.5"],
    ),
    ("[grid]", "[frame]\nlatitude_deg = 45.0\n[grid]", &["frame.longitude_deg is missing"]),
];

#[test]
fn each_bad_input_names_line_field_and_remedy() {
    ScenarioFile::parse("small.toml", GOOD).expect("the scenario that the cases spoil is good");
    let mut wrong = Vec::new();
    for (part, spoilt, says) in CASES {
        assert!(GOOD.contains(part), "{part} is not in the good scenario");
        let text = GOOD.replacen(part, spoilt, 1);
        let error = ScenarioFile::parse("small.toml", &text).expect_err(spoilt).to_string();
        let mut rest = error.as_str();
        if !error.contains("\n  help: ") {
            wrong.push(format!("no remedy in\n{error}"));
        }
        for words in *says {
            match rest.split_once(words) {
                Some((_, after)) => rest = after,
                None => wrong.push(format!("expected {words:?} in\n{error}")),
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_time_that_is_said_to_do_does() {
    let text = GOOD.replacen("max = 300.0", "max = 95.8019", 1);
    ScenarioFile::parse("small.toml", &text).expect("reachable");
    let text = GOOD.replacen("max = 300.0", "max = 95.8018", 1);
    ScenarioFile::parse("small.toml", &text).expect_err("one digit less is not");
}

#[test]
fn lists_beyond_the_capacity_say_the_capacity() {
    let agent = "[[agent]]\nstart = [1, 1]\ngoal = [2, 2]\nspeed_max = 1\naccel_max = 1\n";
    let agents: String =
        (0..9).map(|index| agent.replacen("start", &format!("name = \"a{index}\"\nstart"), 1)).collect();
    let sensors =
        "[[sensor]]\nposition = [1, 1]\nranging = { model = \"rss\", scale = 1, path_loss = 1 }\n".repeat(126);
    let knots: Vec<String> = (0..4097).map(|t| format!("{{ t = {t}, position = [1, 1] }}")).collect();
    let track = format!("[[sensor]]\ntrack = [{}]\n", knots.join(", "));
    for (more, says) in [
        (agents, "agent has 10 entries, and this build has room for 8\n"),
        (sensors, "sensor has 129 entries, and this build has room for 128\n"),
        (track, "sensor[3].track has 4099 entries, and this build has room for 4096\n"),
    ] {
        let error = ScenarioFile::parse("big.toml", &format!("{GOOD}{more}")).expect_err(says).to_string();
        assert!(error.contains(says) && error.contains("help: use at most"), "{error}");
        assert!(error.len() < 600, "long lines are shortened: {error}");
    }
}

#[test]
fn a_missing_file_is_named() {
    let error = ScenarioFile::read("/no/such/file.toml").expect_err("missing").to_string();
    assert!(error.starts_with("/no/such/file.toml: cannot be read: No such file"), "{error}");
}

#[test]
fn odd_but_legal_scenarios_warn() {
    let text = GOOD.replacen("[[objective", "[[sensor]]\nposition = [1, 1]\n[[objective", 1)
        + "[[objective.term]]\nmetric = \"false_alarm\"\n[[objective.term]]\nmetric = \"detection\"\nfrom = 400\n";
    let warnings: Vec<String> =
        ScenarioFile::parse("odd.toml", &text).expect("legal").warnings.iter().map(ToString::to_string).collect();
    assert_eq!(warnings.len(), 3, "{warnings:#?}");
    assert!(warnings[0].starts_with("warning: odd.toml:27: sensor[3] neither ranges nor detects"), "{}", warnings[0]);
    assert!(warnings[1].starts_with("warning: odd.toml:33: objective.term[1] is 0 everywhere"), "{}", warnings[1]);
    assert!(warnings[2].starts_with("warning: odd.toml:35: objective.term[2] never applies"), "{}", warnings[2]);
}

#[test]
fn pooled_sensors_are_read_and_what_has_no_meaning_with_them_is_refused() {
    let energy = |samples: u32| {
        format!(
            "detection = {{ model = \"energy\", samples = {samples}, signal = 1, noise = 1, log_threshold = 0, path_loss = 2 }}\n"
        )
    };
    let pool = "[pooling]\nmodel = \"correlated\"\nlog_threshold = 2.5\ncorrelation = 0.5\n";
    let text = |second: u32, betrayal: &str| {
        GOOD.replacen("[grid]", &format!("{pool}[grid]"), 1)
            .replacen("goal", &format!("jammer = {{ budget = 1.0, detection_model = \"{betrayal}\" }}\ngoal"), 1)
            .replacen(
                "[[sensor]]\n",
                &format!("[[sensor]]\nname = \"a\"\nposition = [1, 1]\n{}[[sensor]]\n", energy(50)),
                1,
            )
            .replacen(
                "[[sensor]]\n",
                &format!("[[sensor]]\nname = \"b\"\nposition = [1, 3]\n{}[[sensor]]\n", energy(second)),
                1,
            )
    };
    let scenario = ScenarioFile::parse("pool.toml", &text(50, "none")).expect("good").scenario;
    assert_eq!(scenario.pooling, Pooling::Correlated { log_threshold: 2.5, correlation: 0.5 });
    let single = scenario.to_core::<f32, 2>().expect("f32");
    assert_eq!(single.view().frame.pooling, Pooling::Correlated { log_threshold: 2.5, correlation: 0.5 });
    for (spoilt, says, help) in [
        (
            text(51, "none"),
            "sensor[1].detection.samples must be the same for all sensors that pool",
            "write `samples = 51`",
        ),
        (
            text(50, "linear"),
            "agent[0].jammer.detection_model must be `none` where sensors pool",
            "leave [pooling] out",
        ),
    ] {
        let error = ScenarioFile::parse("pool.toml", &spoilt).expect_err(says).to_string();
        assert!(error.starts_with("pool.toml:") && error.contains(says) && error.contains(help), "{error}");
    }
    let idle = GOOD.replacen("[grid]", "[pooling]\nmodel = \"uncorrelated\"\nlog_threshold = 1\n[grid]", 1);
    let warnings = ScenarioFile::parse("idle.toml", &idle).expect("legal").warnings;
    assert_eq!(warnings.len(), 1, "{warnings:#?}");
    assert!(warnings[0].to_string().starts_with("warning: idle.toml:4: pooling has no effect"), "{}", warnings[0]);
}

#[test]
fn the_published_scenarios_are_read_whole() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/scenarios");
    let mut count = 0;
    for entry in std::fs::read_dir(folder).expect("scenario folder") {
        let path = entry.expect("entry").path();
        let loaded = ScenarioFile::read(path.to_str().expect("UTF-8")).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(loaded.warnings, [], "{}", path.display());
        assert_eq!(Some(loaded.scenario.name.as_str()), path.file_stem().and_then(|stem| stem.to_str()));
        count += 1;
    }
    assert_eq!(count, 26);
    let read = |name: &str| ScenarioFile::read(&format!("{folder}/{name}.toml")).expect(name).scenario;
    let wight = read("wight-jam");
    assert_eq!(wight.rolling, Some(Rolling { cadence: Cadence::Even { steps: 18 }, reveal: Reveal::Current }));
    assert_eq!(wight.agents[0].jammer.map(|jammer| jammer.budget), Some(1500.0));
    assert!(matches!(wight.regions[1].outline, Outline::Circle { center: [7.0, 1.9], .. }));
    assert_eq!(wight.frame.unit_m, 1000.0);
    let moving = |sensor: &&SensorEntry| matches!(&sensor.motion, MotionEntry::Track(track) if track.len() == 4);
    assert_eq!(wight.sensors.iter().filter(moving).count(), 1);
    assert_eq!(read("square8-mixed").terms[0].window, Window { from: f64::NEG_INFINITY, until: 55.0 });
    assert_eq!(read("volume8-detection").dimension, 3);
}

#[test]
fn steps_may_follow_the_change_that_is_seen() {
    let lengths =
        "[rolling]\nreveal = \"predicted\"\nadaptive = { shortest = 2, longest = 9, change = 0.1 }\n[[objective";
    let text = GOOD.replacen("[[objective", lengths, 1);
    let scenario = ScenarioFile::parse("steps.toml", &text).expect("legal").scenario;
    let cadence = Cadence::Adaptive { shortest: 2, longest: 9, change: 0.1 };
    assert_eq!(scenario.rolling, Some(Rolling { cadence, reveal: Reveal::Predicted }));
}

#[test]
fn both_precisions_are_built() {
    let scenario = ScenarioFile::parse("small.toml", GOOD).expect("good").scenario;
    let single = scenario.to_core::<f32, 2>().expect("f32");
    assert_eq!(single.view().agents[0].speed_max, 0.1_f32);
    assert_eq!(scenario.to_core::<f64, 2>().expect("f64").view().sensors.len(), 3);
    scenario.to_core::<f64, 3>().expect_err("it has two dimensions");
}

#[test]
fn agents_that_start_too_close_together_are_named() {
    let second = "[[agent]]\nstart = [0.8, 1.25]\ngoal = [2, 2]\nspeed_max = 1\naccel_max = 1\n";
    let with = |separation: &str| format!("separation = {separation}\n{GOOD}{second}");
    ScenarioFile::parse("two.toml", &with("0.25")).expect("just far enough");
    let error = ScenarioFile::parse("two.toml", &with("0.5")).expect_err("too close").to_string();
    assert!(error.contains("two.toml:33: agent[1].start is 0.25 from that of uav1"), "{error}");
    assert!(error.contains("must keep a `separation` of 0.5") && error.contains("help: move one"), "{error}");
}

#[test]
fn regions_of_every_kind_reach_the_core() {
    let regions = "[[region]]\nname = \"pond\"\npolygon = [[4, 8], [6, 8], [6, 7]]\nfrom = 5\n\
                   [[region]]\ninside = true\ncenter = [5, 5]\nradius = 8\n";
    let scenario =
        ScenarioFile::parse("r.toml", &format!("separation = 0.5\n{GOOD}{regions}")).expect("legal").scenario;
    let stored = scenario.to_core::<f64, 2>().expect("legal");
    let view = stored.view();
    assert_eq!(view.frame.separation, Some(0.5));
    let quietpath_core::scenario::Shape::Polygon(pond) = &view.regions[0].shape else { panic!("{:?}", view.regions) };
    // Clockwise in the file.
    let corners: Vec<[f64; 2]> = pond.vertices().iter().map(|vertex| [vertex.x, vertex.y]).collect();
    assert_eq!(corners, [[6.0, 7.0], [6.0, 8.0], [4.0, 8.0]]);
    assert_eq!(scenario.regions[0].outline.ring(0), corners);
    assert_eq!((view.regions[0].side, view.regions[0].window.from), (Side::Outside, 5.0));
    assert_eq!(view.regions[1].side, Side::Inside);
    let place =
        |constraint, index| quietpath_core::constraints::Place { constraint, index, agent: 0, node: 37, amount: 0.1 };
    let says = |constraint, index| scenario.describe(&place(constraint, index));
    assert_eq!(says(Constraint::Region, Some(0)), "region[0] (pond) is entered by uav1 at node 37");
    assert_eq!(says(Constraint::Region, Some(1)), "region[1] (region2) is left by uav1 at node 37");
    assert_eq!(says(Constraint::Speed, None), "speed is broken by uav1 at node 37");
}

/// The properties of an object in a JSON Schema, its references followed.
fn properties<'a>(schema: &'a serde_json::Value, of: &'a serde_json::Value) -> Vec<&'a str> {
    let target = of["$ref"].as_str().and_then(|path| schema.pointer(path.trim_start_matches('#'))).unwrap_or(of);
    let mut names: Vec<&str> =
        target["properties"].as_object().expect("an object").keys().map(String::as_str).collect();
    names.sort_unstable();
    names
}

#[test]
fn the_schema_knows_the_keys_that_the_reader_knows() {
    let text = crate::file::schema::scenario_schema();
    let schema: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let same = |found: Vec<&str>, known: &[&str]| {
        let mut known = known.to_vec();
        known.sort_unstable();
        assert_eq!(found, known);
    };
    let definition = |name: &str| properties(&schema, &schema["$defs"][name]);
    same(properties(&schema, &schema), super::read::TOP);
    same(definition("Agent"), super::read::AGENT);
    same(definition("Jammer"), super::read::JAMMER);
    same(definition("Sensor"), super::read::SENSOR);
    same(definition("Term"), super::read::TERM);
    same(definition("Study"), super::study::KEYS);
    same(definition("Wind"), super::study::WIND);
}

#[test]
fn every_scenario_here_is_one_by_the_schema_too() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../sim/scenarios");
    let mut seen = 0;
    for entry in std::fs::read_dir(folder).expect("scenarios") {
        let path = entry.expect("an entry").path();
        let text = std::fs::read_to_string(&path).expect("text");
        let read: Result<crate::file::schema::Scenario, _> = toml::from_str(&text);
        assert!(read.is_ok(), "{}: {read:?}", path.display());
        seen += 1;
    }
    assert!(seen > 20, "{seen} scenarios");
    let spoilt = GOOD.replace("speed_max", "speed_maximum");
    let read: Result<crate::file::schema::Scenario, _> = toml::from_str(&spoilt);
    assert!(read.expect_err("a key that nobody knows").to_string().contains("speed_maximum"));
}
