//! The same front in two recordings of one closure whose clocks differ.

use super::station::Station;
use super::wavespeed::front_delay;
use super::{Estimate, clear_stations, onset, stations};
use crate::recording::Recording;

/// The front at a sensor of one recording and at one of another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FrontPair {
    /// Index of the first recording's sensor among the rig's.
    pub first: usize,
    /// Index of the second recording's sensor.
    pub second: usize,
    /// How far the first sensor is beyond the second one, seen from the supply, m (several pipes: by travel time).
    pub distance_m: f64,
    /// Time of the front at the second sensor on the second clock, less that at the first one on the first, s.
    pub later_s: Estimate,
    /// How long the front takes to rise where it takes longer, s.
    pub rise_s: f64,
}

/// Lays each front of `first` over each of `second`; empty where one of them shows none. Both are of one rig.
pub fn front_pairs(first: &Recording, second: &Recording, temperature_degc: f64) -> Vec<FrontPair> {
    let (of_first, of_second) = (stations(first, temperature_degc), stations(second, temperature_degc));
    let mut pairs = Vec::new();
    for a in clear_stations(&of_first) {
        for b in clear_stations(&of_second) {
            if let Some(later_s) = later(a, b) {
                let distance_m = a.place_m - b.place_m;
                let rise_s = rise_s(a).max(rise_s(b));
                pairs.push(FrontPair { first: a.sensor, second: b.sensor, distance_m, later_s, rise_s });
            }
        }
    }
    pairs
}

fn rise_s(station: &Station) -> f64 {
    station.front.as_ref().map_or(0.0, |front| front.rise * station.coarse.step_s)
}

/// Either front laid over the other, for the lead before one of them may be too short; else the bends where they begin.
fn later(a: &Station, b: &Station) -> Option<Estimate> {
    let backwards = || front_delay(b, a).map(|e| Estimate { value: -e.value, ..e });
    let bends = || {
        let bend = |s: &Station| {
            let (at, error) = onset::bend(&s.coarse, s.front.as_ref().ok()?, s.coarse_sd_m)?;
            Some(Estimate { value: s.coarse.time_s(at), standard_error: error * s.coarse.step_s })
        };
        let (a, b) = (bend(a)?, bend(b)?);
        Some(Estimate { value: b.value - a.value, standard_error: a.standard_error.hypot(b.standard_error) })
    };
    front_delay(a, b).or_else(backwards).or_else(bends)
}
