//! The places of one run, ranked by evidence.
//!
//! A fit that lacks a forcing has moved its variables to make up for it. So they move again, together with the forcing at the best place, and all places
//! are ranked anew from there, until the same place is best twice.

use rayon::prelude::*;

use crate::diagnose::rest::cells::{Run, Times};
use crate::diagnose::rest::inverse::{Belief, Data, Found, MEMORIES, Normal, columns};
use crate::diagnose::rest::places::Spot;
use crate::diagnose::rest::response::response;
use crate::model::ModelError;
use crate::product::dot;

/// Most times that the variables move.
const ROUNDS: usize = 4;
/// What is not known of a variable before the fit is as wide as this many errors of the record.
const WIDE: f64 = 1e4;
/// Evidence that a place may lack to the best one for other memories to be tried there.
const NEAR: f64 = 60.0;

/// A place and its evidence.
pub(crate) struct Ranked {
    pub(crate) spot: Spot,
    pub(crate) found: Found,
}

/// All places of a run, best first.
pub(crate) struct Ranking {
    pub(crate) places: Vec<Ranked>,
    /// The evidence for no forcing at all.
    pub(crate) nothing: Found,
    pub(crate) data: Data,
}

/// What the run leaves at its variables' values, against which a forcing is judged; and how far each free variable may move.
fn data(run: &Run, times: &Times) -> Result<(Data, Vec<(f64, f64)>), ModelError> {
    let cells = run.rows(times);
    let left = run.left_in(&run.x, &cells, true)?;
    let mut slopes = run.slopes(&cells)?;
    let rows = cells.0;
    let mut y: Vec<f64> = left.iter().zip(&rows).map(|(l, row)| l / row.sd_m).collect();
    let mut reach = Vec::new();
    for (slope, &j) in slopes.iter_mut().zip(&run.free) {
        slope.iter_mut().zip(&rows).for_each(|(s, row)| *s /= row.sd_m);
        let wide = WIDE / dot(slope, slope).sqrt().max(f64::MIN_POSITIVE);
        let (towards, sd) = match run.beliefs[j] {
            Some((mean, sd)) if sd < wide => (mean - run.x[j], sd),
            _ => (0.0, wide),
        };
        y.iter_mut().zip(&*slope).for_each(|(y, s)| *y -= s * towards);
        slope.iter_mut().for_each(|s| *s *= sd);
        reach.push((towards, sd));
    }
    Ok((Data { rows, y, slopes }, reach))
}

/// The normal equations of a place.
///
/// # Errors
/// As [`response`].
pub(crate) fn normal(run: &Run, data: &Data, spot: &Spot, times: &Times) -> Result<Normal, ModelError> {
    let response = response(run, spot, times)?;
    Ok(Normal::of(data, columns(&data.rows, &response, times), response.len()))
}

/// Ranks `spots`, and moves the run's variables to where they are with a forcing at the best of them.
///
/// # Errors
/// As [`Run::left_in`].
pub(crate) fn ranked(run: &mut Run, spots: &[Spot], times: &Times) -> Result<Ranking, ModelError> {
    let mut memory = MEMORIES[1];
    let mut best_before = None;
    for round in 1.. {
        let (data, reach) = data(run, times)?;
        let judged = |spot: &Spot| {
            let normal = normal(run, &data, spot, times).ok()?;
            Some((Ranked { spot: spot.clone(), found: normal.best(memory)? }, normal))
        };
        let mut places: Vec<(Ranked, Normal)> = spots.par_iter().filter_map(judged).collect();
        sort(&mut places);
        let Some(top) = places.first().map(|(r, _)| r.found.evidence) else { break };
        places.iter_mut().filter(|(r, _)| r.found.evidence > top - NEAR).for_each(|(ranked, normal)| {
            for found in MEMORIES.iter().filter(|m| **m != memory).filter_map(|m| normal.best(*m)) {
                if found.evidence > ranked.found.evidence {
                    ranked.found = found;
                }
            }
        });
        sort(&mut places);
        let (best, normal) = &places[0];
        memory = best.found.belief.memory;
        let settled = best_before.as_ref() == Some(&best.spot) || round == ROUNDS;
        let nothing = Normal::of(&data, Vec::new(), 0).best(memory);
        let moves = normal.solved(&best.found).map(|s| s.moves);
        best_before = Some(best.spot.clone());
        if let (true, Some(nothing)) = (settled, nothing) {
            let places = places.into_iter().map(|(ranked, _)| ranked).collect();
            return Ok(Ranking { places, nothing, data });
        }
        let Some(moves) = moves else { break };
        run.step(&moves.iter().zip(&reach).map(|(m, (towards, sd))| towards + m * sd).collect::<Vec<_>>());
    }
    let (data, _) = data(run, times)?;
    let nothing = Found { belief: Belief { memory, log_power: 0.0 }, evidence: 0.0, excess: 1.0, left: 0.0 };
    Ok(Ranking { places: Vec::new(), nothing, data })
}

fn sort(places: &mut [(Ranked, Normal)]) {
    places.sort_by(|(a, _), (b, _)| b.found.evidence.total_cmp(&a.found.evidence));
}
