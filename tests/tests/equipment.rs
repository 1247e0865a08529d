//! What the paper says of equipment holds for our plans: jamming, a helper, and radio silence (section 4.4).
//!
//! "Without jamming" means the same path with every level at zero: where the sensors would locate an agent well.

use quietpath_bridge::file::plan::AgentPlan;
use quietpath_bridge::file::{PlanFile, ScenarioFile};
use quietpath_bridge::planning::{Options, assess, plan};
use quietpath_core::Metric;
use quietpath_tests::scenario;

/// How far a budget may be overdrawn, as a part of it.
const OVERDRAFT_MAX: f64 = 1e-9;
/// How much of a budget may be left where all of it is of use, as a part of it: a planner that comes from inside stops short.
const REST_MAX: f64 = 1e-6;

/// A scenario, its plan, and what the plan is worth.
struct Flown {
    scenario: ScenarioFile,
    plan: PlanFile,
}

impl Flown {
    fn new(scenario: ScenarioFile) -> Self {
        let planned = plan(&scenario, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
        assert!(planned.assessment.feasible, "{}: {:?}", scenario.name, planned.assessment.worst);
        Self { scenario, plan: planned.plan }
    }

    /// Logarithm of the AEE of an agent at nodes 1 .. N of the path flown, had nobody jammed.
    fn log_aee_unjammed(&self, agent: usize) -> Vec<f64> {
        let mut silent = self.plan.clone();
        for agent in &mut silent.agents {
            agent.jam = agent.jam.as_ref().map(|levels| vec![0.0; levels.len()]);
        }
        let found = assess(&self.scenario, &silent, "the plan without jamming").unwrap_or_else(|e| panic!("{e}"));
        found.agents[agent].metric(Metric::LogAee).expect("the sensors range")[1..].to_vec()
    }

    /// Logarithm of the AEE of an agent at nodes 1 .. N.
    fn log_aee(&self, agent: usize) -> Vec<f64> {
        let found = assess(&self.scenario, &self.plan, "the plan").unwrap_or_else(|error| panic!("{error}"));
        found.agents[agent].metric(Metric::LogAee).expect("the sensors range")[1..].to_vec()
    }

    /// A control of an agent at nodes 1 .. N.
    fn levels(&self, agent: usize, control: fn(&AgentPlan) -> &Option<Vec<f64>>) -> &[f64] {
        &control(&self.plan.agents[agent]).as_ref().expect("the agent has this equipment")[1..]
    }

    /// Budget spent: (49), (55), s.
    fn spent(&self, levels: &[f64]) -> f64 {
        levels.iter().sum::<f64>() * self.plan.duration / levels.len() as f64
    }

    /// Spends all of a budget, and no more.
    fn assert_spends(&self, levels: &[f64], budget: f64) {
        let (name, spent) = (&self.scenario.name, self.spent(levels));
        println!("{name}: {spent:.12} s of {budget} s");
        assert!(spent <= budget * (1.0 + OVERDRAFT_MAX), "{name}: spends {spent} of {budget}");
        assert!(spent >= budget * (1.0 - REST_MAX), "{name}: leaves some of {budget}, spends {spent}");
    }
}

fn jam(agent: &AgentPlan) -> &Option<Vec<f64>> {
    &agent.jam
}

fn dropout(agent: &AgentPlan) -> &Option<Vec<f64>> {
    &agent.dropout
}

/// A scenario with the jamming budget of every jammer set, s.
fn with_budget(name: &str, budget: f64) -> ScenarioFile {
    let mut scenario = scenario(name);
    for jammer in scenario.agents.iter_mut().filter_map(|agent| agent.jammer.as_mut()) {
        jammer.budget = budget;
    }
    scenario
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Pearson's correlation.
fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let sum = |x: &[f64], y: &[f64], mx: f64, my: f64| x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>();
    sum(a, b, mean_a, mean_b) / (sum(a, a, mean_a, mean_a) * sum(b, b, mean_b, mean_b)).sqrt()
}

/// Mean of `levels` where `error` is among its lowest quarter, and where it is among its highest.
fn in_low_and_high(levels: &[f64], error: &[f64]) -> (f64, f64) {
    let mut order: Vec<usize> = (0..levels.len()).collect();
    order.sort_by(|a, b| error[*a].total_cmp(&error[*b]));
    let quarter = order.len() / 4;
    let over = |nodes: &[usize]| mean(&nodes.iter().map(|node| levels[*node]).collect::<Vec<_>>());
    (over(&order[..quarter]), over(&order[order.len() - quarter..]))
}

#[test]
fn jamming_goes_where_the_location_error_is_low() {
    let flown = Flown::new(scenario("square8-jam"));
    let (levels, error) = (flown.levels(0, jam), flown.log_aee_unjammed(0));
    let agreement = -correlation(levels, &error);
    let (low, high) = in_low_and_high(levels, &error);
    println!("correlation with -ln AEE {agreement:.3}; level {low:.3} where the error is low, {high:.3} where high");
    assert!(agreement > 0.8, "jamming does not follow need: correlation {agreement}");
    assert!(low > 1.2 * high, "level {low} in low error, {high} in high");
}

#[test]
fn budgets_are_met_and_spent_where_spending_is_free() {
    for budget in [5.0, 30.0, 60.0] {
        let flown = Flown::new(with_budget("square8-jam", budget));
        flown.assert_spends(flown.levels(0, jam), budget);
    }
    for name in ["dropout4-17", "dropout4-35"] {
        let flown = Flown::new(scenario(name));
        let budget = flown.scenario.agents[0].dropout.expect("dropout").budget;
        flown.assert_spends(flown.levels(0, dropout), budget);
    }
}

/// Betrayal makes jamming cost something: beyond the seconds that pay, a budget is left unspent. The 30 s of the scenario
/// all pay, in the reference solution too.
#[test]
fn a_jammer_that_is_betrayed_leaves_a_generous_budget_unspent() {
    for budget in [60.0, 90.0] {
        let free = Flown::new(with_budget("square8-jam", budget));
        free.assert_spends(free.levels(0, jam), budget);
        let betrayed = Flown::new(with_budget("square8-jam-risk", budget));
        let part = betrayed.spent(betrayed.levels(0, jam));
        println!("{part:.4} s of {budget} s where it betrays");
        assert!(part < 0.9 * budget, "{part} of {budget}");
    }
}

#[test]
fn a_helper_raises_the_error_of_the_other_all_the_way() {
    let flown = Flown::new(scenario("square8-team"));
    flown.assert_spends(flown.levels(1, jam), 30.0);
    let (jammed, unjammed) = (flown.log_aee(0), flown.log_aee_unjammed(0));
    let gains: Vec<f64> = jammed.iter().zip(&unjammed).map(|(jammed, unjammed)| jammed - unjammed).collect();
    let (low, high) = in_low_and_high(&gains, &unjammed);
    println!("ln AEE gains {low:.3} where it is low, {high:.3} where it is high");
    assert!(gains.iter().all(|gain| *gain > 0.1), "{gains:.2?}");
}

/// The paper sees its helper jam most while the other is in the lowest error. Under the objective of the scenario that is not
/// the best one can do, in the reference solution neither: how much a level helps depends on the distances of the helper from
/// the sensors as well, and it jams for itself too. What does hold is that its levels are where they do most: moved to where
/// the error is lowest, or to where it is highest, they do less.
#[test]
fn a_helper_jams_where_a_second_of_it_does_most() {
    let flown = Flown::new(scenario("square8-team"));
    let (levels, error) = (flown.levels(1, jam), flown.log_aee_unjammed(0));
    let (low, high) = in_low_and_high(levels, &error);
    println!("helper's level {low:.3} where the other's error is low, {high:.3} where it is high");
    let mut order: Vec<usize> = (1..=levels.len()).collect();
    order.sort_by(|a, b| error[*a - 1].total_cmp(&error[*b - 1]));
    let quarter = order.len() / 4;
    let (lowest, highest) = (&order[..quarter], &order[order.len() - quarter..]);
    let best = flown.plan.objective.expect("an objective");
    for (what, up, down) in [("low", lowest, highest), ("high", highest, lowest)] {
        let mut moved = flown.plan.clone();
        let levels = moved.agents[1].jam.as_mut().expect("the helper jams");
        up.iter().for_each(|node| levels[*node] += 0.05);
        down.iter().for_each(|node| levels[*node] -= 0.05);
        let found = assess(&flown.scenario, &moved, "the plan with jamming moved").unwrap_or_else(|e| panic!("{e}"));
        println!("{best:.4} as planned, {:.4} with more of it where the error is {what}", found.objective);
        assert!(found.feasible, "{:?}", found.worst);
        assert!(
            found.objective > best,
            "{} instead of {best} with more of it where the error is {what}",
            found.objective
        );
    }
}

#[test]
fn silence_is_full_or_none_except_where_it_begins_or_ends() {
    for name in ["dropout4-17", "dropout4-35"] {
        let flown = Flown::new(scenario(name));
        let levels = flown.levels(0, dropout);
        let full = levels.iter().filter(|level| **level >= 0.999).count();
        println!("{name}: {full} of {} nodes silent; {levels:.2?}", levels.len());
        assert!(full > 0, "{name}: never silent");
        for (node, level) in levels.iter().enumerate() {
            let partial = (0.001..0.999).contains(level);
            let neighbours =
                [node.checked_sub(1), Some(node + 1)].map(|at| at.and_then(|at| levels.get(at)).copied());
            let is_edge = neighbours.iter().any(|at| at.is_none_or(|at| at <= 0.001))
                && neighbours.iter().any(|at| at.is_none_or(|at| at >= 0.999));
            assert!(!partial || is_edge, "{name}: level {level} at node {}", node + 1);
        }
    }
}
