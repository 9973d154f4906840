//! From a recording to its features, without a model of the run: noise, steady levels, closure, extrema, period,
//! damping and the wave speed in four ways, each with its uncertainty. Heads are metres of the fluid column, g = 9.81
//! m/s².
//!
//! | file | what it finds |
//! | --- | --- |
//! | `trace` | the head on an even grid, gaps marked |
//! | `noise` | white and coloured noise, what oscillates in it, the converter's step |
//! | `coloured` | the likelihood of coloured noise |
//! | `hum`, `sine` | tones of the mains; one tone |
//! | `interpolated` | the points of a record that was drawn between them |
//! | `front` | the first rise and fall of a sensor |
//! | `onset`, `closure` | when the closure starts and ends |
//! | `levels` | head before and after, flow, temperature |
//! | `matching`, `wavespeed` | delays between fronts, and the wave speed they give |
//! | `between` | the same front in two recordings |
//! | `period` | the delay after which the record repeats itself |
//! | `extrema` | half cycles, damping |
//! | [`oscillation`](mod@oscillation) | the same of a head known without noise |
//! | [`spectrum`] | amplitude over frequency of a trace |
//! | `inspect` | all of it |
//! | [`check`] | does a recording agree with its rig |
//! | [`doubts`](mod@doubts) | numbers that cannot all be right, before a fit |
//! | [`window`] | the part of a long record that is used |
//! | [`faults`] | sensors that do not follow, or in another unit |

pub(crate) mod between;
pub mod check;
pub(crate) mod closure;
pub(crate) mod coloured;
pub mod doubts;
pub(crate) mod error;
pub(crate) mod extrema;
pub mod faults;
pub(crate) mod features;
pub(crate) mod front;
pub mod harmonics;
pub(crate) mod hum;
pub(crate) mod inspect;
pub(crate) mod interpolated;
pub mod levels;
pub(crate) mod matching;
pub(crate) mod noise;
pub(crate) mod onset;
pub mod oscillation;
pub(crate) mod period;
pub(crate) mod project;
pub(crate) mod sine;
pub mod spectrum;
pub(crate) mod station;
#[cfg(test)]
pub(crate) mod testing;
pub(crate) mod trace;
pub(crate) mod wavespeed;
pub mod window;

pub use crate::signal::between::{FrontPair, front_pairs};
pub use crate::signal::error::SignalError;
pub use crate::signal::features::{Closure, Crossings, Estimate, Extremum, Features, SensorFeatures, WaveSpeeds};
pub use crate::signal::hum::Tone;
pub use crate::signal::inspect::inspect;
pub use crate::signal::interpolated::Corners;
pub use crate::signal::noise::Noise;
pub use crate::signal::station::heads;
