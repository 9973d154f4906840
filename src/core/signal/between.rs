//! The same front in two recordings of one closure with different clocks.

use crate::recording::Recording;
use crate::signal::features::Estimate;
use crate::signal::onset;
use crate::signal::station::Station;
use crate::signal::station::{clear_stations, stations};
use crate::signal::wavespeed::front_delay;

/// The front at a sensor of one recording and at one of another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontPair {
    /// Index of the first recording's sensor among the rig's.
    pub first: usize,
    /// Index of the second recording's sensor.
    pub second: usize,
    /// Distance from the second sensor to the first, positive away from the supply, m (several pipes: by travel time).
    pub distance_m: f64,
    /// Time of the front at the second sensor on the second clock, minus that at the first sensor on the first clock,
    /// s.
    pub later_s: Estimate,
    /// Time of the front on the second clock, s.
    pub at_s: f64,
    /// Rise time of the slower of the two fronts, s.
    pub rise_s: f64,
}

/// A record shows the level before the front if it begins this share of the rise earlier, and this many points.
const LEAD_OF_RISE: f64 = 0.1;
const LEAD_POINTS: f64 = 3.0;
/// After the first front the head falls below the level before it by more than this share of its rise. After a later
/// front, which comes from a trough, it does not.
const TROUGH: f64 = 0.03;
/// A front of fewer samples than this has no shape to match: only the time of its middle is known.
const SHARP: f64 = 4.0;
/// A front of fewer samples than this may be anywhere between two of them; else its middle is known to this share of a
/// step.
const JUMP: f64 = 1.5;
const MIDDLE: f64 = 0.15;

/// Matches each first front of `first` with each of `second`; empty if one recording has none. Both are of one rig.
pub fn front_pairs(first: &Recording, second: &Recording, temperature_degc: f64) -> Vec<FrontPair> {
    let (of_first, of_second) = (stations(first, temperature_degc), stations(second, temperature_degc));
    let mut pairs = Vec::new();
    let fronts = |stations| clear_stations(stations).into_iter().filter(|station| shows_first(station));
    for a in fronts(&of_first) {
        for b in fronts(&of_second) {
            if let Some(later_s) = later(a, b) {
                let distance_m = a.place_m - b.place_m;
                let rise_s = rise_s(a).max(rise_s(b));
                let at_s = b.front.as_ref().map_or(0.0, |front| b.coarse.time_s(front.onset));
                pairs.push(FrontPair { first: a.sensor, second: b.sensor, distance_m, later_s, at_s, rise_s });
            }
        }
    }
    pairs
}

fn rise_s(station: &Station) -> f64 {
    station.front.as_ref().map_or(0.0, |front| front.rise * station.coarse.step_s)
}

/// Whether the record has the steady level before its front and the front is the first one: a record that begins within
/// or after a front shows only a part of it, or a later one.
fn shows_first(station: &Station) -> bool {
    let (Ok(front), head) = (&station.front, &station.coarse.head_m) else { return false };
    let after = head.get(front.half_fall as usize..).unwrap_or_default();
    let lowest = after.iter().copied().fold(f64::INFINITY, f64::min);
    // a record that ends before the trough cannot tell
    let says = after.len() as f64 > front.half_fall - front.onset;
    let is_first = !says || lowest < front.base_m - TROUGH * front.height_m();
    is_first && front.onset >= (LEAD_OF_RISE * front.rise).max(LEAD_POINTS)
}

/// Time at which a front of few samples passes its middle.
fn middle_s(station: &Station, true_rise_s: f64) -> Option<Estimate> {
    let (front, trace) = (station.front.as_ref().ok()?, &station.coarse);
    let at = front.rises_through(trace, front.base_m + 0.5 * front.height_m())?;
    let points = if true_rise_s < JUMP * trace.step_s { 1.0 / 12f64.sqrt() } else { MIDDLE };
    Some(Estimate { value: trace.time_s(at), standard_error: points * trace.step_s })
}

fn difference(a: Estimate, b: Estimate) -> Estimate {
    Estimate { value: b.value - a.value, standard_error: a.standard_error.hypot(b.standard_error) }
}

/// Delay between two fronts: matches either front with the other, because the lead of one of them may be too short;
/// else compares the bends where they begin. Fronts of few samples are compared by their middles.
fn later(a: &Station, b: &Station) -> Option<Estimate> {
    let backwards = || front_delay(b, a).map(|e| Estimate { value: -e.value, ..e });
    let bends = || {
        let bend = |s: &Station| {
            let (at, error) = onset::bend(&s.coarse, s.front.as_ref().ok()?, s.coarse_sd_m)?;
            Some(Estimate { value: s.coarse.time_s(at), standard_error: error * s.coarse.step_s })
        };
        Some(difference(bend(a)?, bend(b)?))
    };
    let rise_s = rise_s(a).min(rise_s(b));
    let step_s = a.coarse.step_s.max(b.coarse.step_s);
    if rise_s < SHARP * step_s {
        let (a, b) = (middle_s(a, rise_s)?, middle_s(b, rise_s)?);
        return Some(difference(a, b));
    }
    let laid = front_delay(a, b).or_else(backwards).or_else(bends)?;
    // the coarser record limits the resolution
    Some(Estimate { standard_error: laid.standard_error.max(MIDDLE * step_s), ..laid })
}
