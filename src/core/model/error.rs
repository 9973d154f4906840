//! Why a model cannot be simulated, in sentences.

use crate::rig::Place;
use crate::shown::number;

/// What can be wrong with a model or a simulation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum ModelError {
    #[error(
        "{reaches} reaches are too few: the shortest of these pipes, or of the sections they are given, is shorter than a reach, and they need at \
         least {needed} (option `set` reaches={needed} of a simulation, option `most_reaches` {needed} of a fit)"
    )]
    TooFewReaches { reaches: usize, needed: usize },
    #[error(
        "effect '{effect}' is written for pipes in series: leave it out, or describe the rig as one line without branches"
    )]
    OneLine { effect: String },
    #[error("{name} = {} is outside its physical range ({allowed})", number(*value))]
    Value { name: String, value: f64, allowed: &'static str },
    #[error("unknown effect '{name}'; did you mean '{nearest}'? Known are: {known}")]
    UnknownEffect { name: String, nearest: String, known: String },
    #[error("{said}")]
    OwnEffect { said: String },
    #[error(
        "'{name}' is an effect of another rig's own; write effects/{name}.toml beside the file of rig '{rig}', or leave the effect out"
    )]
    OfAnotherRig { name: String, rig: String },
    #[error("'{item}': the number of elements must be a whole number from {low} to {high}")]
    Elements { item: String, low: usize, high: usize },
    #[error("'{item}': this effect has no elements to number")]
    NoElements { item: String },
    #[error("the effect '{name}' is named twice")]
    EffectTwice { name: String },
    #[error(
        "friction takes {share:.3} of the impedance over one reach, more than the scheme resolves; give the grid at least {needed} reaches (option `set reaches={needed}` of a simulation, option `most_reaches {needed}` of a fit)"
    )]
    FrictionTooCoarse { share: f64, needed: usize },
    #[error(
        "{steps:.0} steps on {nodes} nodes would need {gib:.1} GiB of memory, and {limit_gib:.1} GiB are free for it; shorten the \
         duration or take fewer reaches (option `set` reaches=… of a simulation, option `most_reaches` of a fit)"
    )]
    TooLarge { steps: f64, nodes: usize, gib: f64, limit_gib: f64 },
    #[error(
        "the solution stopped being finite {time_s:.4} s after the start of the closure, at the node \
         {:.2} m {along}, in a model with {effects}; check the parameter values",
        .place.position_m
    )]
    NotFinite { time_s: f64, place: Place, along: String, effects: String },
    #[error(
        "there is no pipe '{name}' on which an effect could be; the network has {known} (pipes in series are one line: give the position)"
    )]
    UnknownPipe { name: String, known: String },
    #[error(
        "'{effect}' changes the head of a reservoir, and nothing feeds this rig but '{node}', whose head follows from its own law; leave the effect \
         out, or make '{node}' a [[node]] of kind \"reservoir\""
    )]
    NoReservoir { effect: String, node: String },
    #[error(
        "'{effect}': the rig has several valves that close, {known}; name the one that it means, as in {effect}@{first}"
    )]
    WhichValve { effect: String, first: String, known: String },
    #[error("there is no valve '{name}' that closes; the rig has {known}")]
    UnknownValve { name: String, known: String },
    #[error("'{item}': this effect concerns no single sensor, pipe or valve")]
    NoSensor { item: String },
    #[error("'{one}' and '{other}' cannot be together: {why}")]
    Excluded { one: String, other: String, why: &'static str },
    #[error("there is no pressure sensor '{name}'; the rig has {known}")]
    UnknownSensor { name: String, known: String },
    #[error(
        "the steady flow before the closure cannot be found: look for pipes without a supply, and for losses and demands out of proportion"
    )]
    NoSteadyFlow,
    #[error("an upstream end of kind 'measured' needs the head measured at position 0")]
    NoSupplyHead,
    #[error("the head before the valve needs at least one sample, and times that increase")]
    NoValveHead,
    #[error("the computation was stopped")]
    Stopped,
}
