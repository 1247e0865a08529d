//! Measurements: how good the plans are, how long they take, and how others do on the same files.
//!
//! | module | what |
//! |---|---|
//! | [`published`] | every scenario of the program against the best known plans and against the peers |
//! | [`random`] | made-up scenarios against a multi-start of the same solver |
//! | [`scaling`] | time against nodes, sensors and agents; landscapes against NumPy |
//! | [`peer`] | other solvers, as programs that answer requests |
//! | [`page`] | `docs/benchmarks.md`, section by section |
//! | [`machine`] | where and when it was measured |
//! | [`figure`] | medians, quantiles, fitted exponents |
//!
//! Times of ours are those of the core's planning call alone, as plans report them.

pub mod figure;
pub mod machine;
pub mod page;
pub mod peer;
pub mod published;
pub mod random;
pub mod scaling;
