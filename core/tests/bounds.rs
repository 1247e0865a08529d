//! What a plan counts never exceeds what its settings allow, on scenarios of every kind, and comes near it where the settings
//! are what ends a plan.

mod made_up;

use made_up::{Made, scenarios};
use quietpath_core::solver::{Bounds, Outcome, Settings, Start, Workspace, plan};

type Memory = Workspace<f64, 2, 9, 8, 3>;

fn settings() -> [Settings<f64>; 3] {
    // Too little to come to rest, so that the settings are what ends a plan.
    let little = Settings { variants: 1, candidates: 1, projection_steps: 5, tolerance: 0.0, ..Settings::default() };
    [
        Settings { iterations: 3, refinements: 2, line_search_steps: 1, ..little },
        Settings { iterations: 0, refinements: 3, variants: 0, candidates: 0, ..little },
        Settings { iterations: 8, ..Settings::frugal() },
    ]
}

fn counts(outcome: &Outcome<f64, 2>) -> Bounds {
    Bounds {
        iterations: outcome.iterations,
        refinements: outcome.refinements,
        factorizations: outcome.factorizations,
        evaluations: outcome.evaluations,
        projection_steps: outcome.projection_steps,
    }
}

fn figures(bounds: &Bounds) -> [usize; 5] {
    [bounds.iterations, bounds.refinements, bounds.factorizations, bounds.evaluations, bounds.projection_steps]
}

#[test]
fn no_plan_takes_more_than_its_settings_allow() {
    let mut memory = Box::new(Memory::new());
    let mut nearest = [0.0_f64; 5];
    let mut planned = 0;
    let all: Vec<Made<2>> = scenarios();
    for (number, made) in all.iter().enumerate() {
        let Ok(stored) = made.stored() else { continue };
        let agents = made.agents.len();
        // One of them each: all would take long.
        for settings in settings().into_iter().skip(number % 3).take(1) {
            let starts =
                [(Start::Straight, settings.bounds_near()), (Start::Global, settings.bounds_everywhere(agents))];
            for (start, bounds) in starts {
                let Ok(outcome) = plan(&stored.view(), &settings, start, &mut memory, &mut || false) else {
                    continue;
                };
                planned += 1;
                let pairs = figures(&counts(&outcome)).into_iter().zip(figures(&bounds)).zip(&mut nearest);
                for ((count, most), nearest) in pairs {
                    assert!(count <= most, "{}: {count} of {most} in {outcome:?} with {settings:?}", made.name);
                    *nearest = nearest.max(count as f64 / most.max(1) as f64);
                }
            }
        }
    }
    assert!(planned > all.len(), "only {planned} plans");
    // Iterations and steps of the refinement are what the settings are about: half of them are there for obstacles.
    assert!(nearest[0] >= 0.5 && nearest[1] >= 0.5, "a bound that nothing comes near: {nearest:?}");
}
