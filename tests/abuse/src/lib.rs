//! Inputs that nobody should send.
//!
//! A *target* is a function of some bytes that panics where a promise is broken: not only where the program crashes, but
//! where it works without end, or accepts what it should not. `fuzz/` feeds the targets from a fuzzer, `tests/corpus.rs`
//! with what was found so far, on stable, in every run of the tests.
//!
//! | target | bytes are | promises |
//! |---|---|---|
//! | [`text::scenario`] | a scenario file | a scenario whose straight line can be weighed and exported, or an error that names the file |
//! | [`text::plan`] | a plan file | a plan that reads back as written and can be weighed, exported and flown, or an error that names the file |
//! | [`text::observations`] | lines of a tracker | the scenario is as good as before |
//! | [`wire::bytes`] | what a link hears | frames that encode as they were decoded; strangers capture nothing |
//! | [`machines::messages`] | messages with their times | every machine ends, says a bounded amount, and emits nothing it should not |
//! | [`problem::planned`] | a problem for the core | a feasible plan, or a reason; bounded work; never worse with more time |
//!
//! [`problem`] draws its problems from bytes, so the same code draws those of the campaign `cargo xtask numbers`, from a
//! seed.

pub mod dice;
pub mod machines;
pub mod problem;
pub mod text;
pub mod wire;

/// A target: panics where a promise is broken.
pub type Target = fn(&[u8]);

/// All targets by name: that of their file in `fuzz/fuzz_targets` and of their folder in `fuzz/corpus`.
pub const TARGETS: [(&str, Target); 6] = [
    ("scenario", text::scenario),
    ("plan", text::plan),
    ("observations", text::observations),
    ("wire", wire::bytes),
    ("machines", machines::messages),
    ("problem", problem::planned),
];
