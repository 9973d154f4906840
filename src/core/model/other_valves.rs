//! The valves that close beside the first: each has a closing time and a start of its own, which all runs on the rig
//! share.
//!
//! Their areas are known, so that the flow before the closure follows; the first valve's area follows from its flow.

use crate::model::parameter::Parameter;
use crate::rig::{Closing, Rig};

/// Parameters of each of them.
const EACH: usize = 2;

/// Values of one of them.
pub(crate) struct OwnClosing {
    pub time_s: f64,
    pub start_s: f64,
}

/// Name of a valve's closing time.
pub(crate) fn closing_time_of(valve: &str) -> String {
    format!("closing_time_s[{valve}]")
}

/// Name of a valve's start.
pub(crate) fn closing_start_of(valve: &str) -> String {
    format!("closing_start_s[{valve}]")
}

/// Their parameters, in the order of the graph's nodes, on a rig of this period `4L/a`.
pub(crate) fn parameters(rig: &Rig, period_s: f64) -> impl Iterator<Item = Parameter> {
    rig.graph.others_that_close().flat_map(move |(_, name, _, closing)| {
        let Closing { start_s, time_s, time_tolerance, .. } = *closing;
        let nominal = Parameter::log(
            closing_time_of(name),
            "s",
            "how long this valve takes to close",
            time_s,
            time_s / 20.0,
            time_s * 20.0,
        );
        let start = Parameter::linear(
            closing_start_of(name),
            "s",
            "when this valve starts to close, after the first one does",
            start_s,
            0.0,
            start_s + period_s,
        );
        [nominal.known_within(time_s, time_tolerance), start]
    })
}

/// How many parameters they have.
pub(crate) fn count(rig: &Rig) -> usize {
    EACH * rig.graph.others_that_close().count()
}

/// What their parameters say, in the order of the graph's nodes.
pub(crate) fn closings(own: &[f64]) -> impl Iterator<Item = OwnClosing> {
    own.chunks_exact(EACH).map(|own| OwnClosing { time_s: own[0], start_s: own[1] })
}
