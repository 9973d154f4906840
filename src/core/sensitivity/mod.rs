//! Which parameter moves what: how the peaks of a closure, their times, its phase and its damping answer to the
//! parameters of a model.
//!
//! | file | what it holds |
//! | --- | --- |
//! | [`features`] | what is read out of each simulated head |
//! | [`factor`] | a parameter and the range over which it varies |
//! | [`subject`] | the model under study: from a point of the unit cube to features |
//! | [`anova`] | one-way analysis of variance |
//! | [`levels`] | the design that the analysis of variance is made of |
//! | [`morris`] | elementary effects |
//! | [`sobol`] | shares of the variance, first-order and total |
//! | [`map`] | features over two parameters, and what raising a third changes there |
//! | [`study`] | all of it for one model, as one document |
//!
//! A simulation may fail (a grid too coarse for so much friction), and a feature may not exist (a head that creeps to
//! its end has no second peak). Such values are NaN, are left out of every statistic, and are counted.

pub mod anova;
pub mod error;
pub mod factor;
pub mod features;
pub mod levels;
pub mod map;
pub mod morris;
pub mod sobol;
pub mod study;
pub mod subject;

pub use crate::sensitivity::error::SensitivityError;

/// Called after each simulation.
pub type Tick<'a> = &'a (dyn Fn() + Sync);
