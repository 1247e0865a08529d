//! Problems for the core, drawn from bytes, and what must be true of every plan.
//!
//! Geometry is degenerate on purpose: sensors at one place or in one line, a start at a sensor or at the goal, deadlines
//! that leave no time, budgets of nothing, one interval.

mod draw;
mod judge;

pub use draw::{AGENTS, KNOTS, NODES, Problem, SENSORS};
pub use judge::{Broken, Verdict, judge, roll};

use fastrand::Rng;
use quietpath_core::Real;
use quietpath_core::solver::Settings;

use crate::dice::{Dice, Mood};

/// Precisions and dimensions, by [kind](of_kind).
pub const KINDS: [&str; 4] = ["f64, 2-D", "f32, 2-D", "f64, 3-D", "f32, 3-D"];

/// Bytes that a problem is drawn from: more than it takes.
const BYTES: usize = 2048;

/// Problem `index` of the sequence that `seed` begins: its kind, and bytes for it, one draw after the other, of which the first
/// that is no [`Verdict::Refused`] counts.
pub fn numbered(seed: u64, index: u64) -> (usize, impl Iterator<Item = Vec<u8>>) {
    let kind = usize::try_from(index % 4).unwrap_or_default();
    // Neighbouring seeds must not give neighbouring sequences.
    let mut random = Rng::with_seed((seed << 32) ^ (index / 4).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    (kind, std::iter::repeat_with(move || (0..BYTES).map(|_| random.u8(..)).collect()))
}

/// Plans a problem of some bytes that makes sense with default settings, in one of [`KINDS`], and judges the plan. It is
/// compiled here, where planning is compiled already.
///
/// # Errors
/// The promise that is broken.
pub fn of_kind(kind: usize, bytes: &[u8]) -> Result<Verdict, Broken> {
    let mut dice = Dice::new(bytes, Mood::Sane);
    match kind {
        0 => judge(&Problem::<f64, 2>::draw(&mut dice), &Settings::default()),
        1 => judge(&Problem::<f32, 2>::draw(&mut dice), &Settings::default()),
        2 => judge(&Problem::<f64, 3>::draw(&mut dice), &Settings::default()),
        _ => judge(&Problem::<f32, 3>::draw(&mut dice), &Settings::default()),
    }
}

/// Plans a problem of some bytes, in either precision and both dimensions, and judges the plan.
///
/// # Panics
/// A promise is broken.
pub fn planned(bytes: &[u8]) {
    // The first byte says whether numbers may be anything.
    let (first, rest) = bytes.split_first().unwrap_or((&0, &[]));
    let mut dice = Dice::new(rest, if first % 2 == 0 { Mood::Wild } else { Mood::Sane });
    let verdict = match dice.below(4) {
        0 => one::<f64, 2>(&mut dice),
        1 => one::<f32, 2>(&mut dice),
        2 => one::<f64, 3>(&mut dice),
        _ => one::<f32, 3>(&mut dice),
    };
    if let Err(broken) = verdict {
        panic!("{broken:?}");
    }
}

fn one<T: Real, const DIM: usize>(dice: &mut Dice<'_>) -> Result<Verdict, Broken> {
    let problem = Problem::<T, DIM>::draw(dice);
    let settings = Settings { iterations: 60, refinements: 20, ..Settings::default() };
    let verdict = judge(&problem, &settings)?;
    roll(&problem, &settings, dice)?;
    Ok(verdict)
}
