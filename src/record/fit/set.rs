//! A clock that was set while it ran, and whose stamps do not say so: the least delays of its messages lie on two levels.

use super::QUARTZ_DRIFT;
use crate::robust::{median, sd_about};

/// A step is no chance where it is this many times what delays scatter, and at least this, ns.
const FAR: f64 = 8.0;
const LEAST_NS: f64 = 2e6;
/// What a piece off its level counts at most, ns, as one in which all was late.
const MOST_NS: f64 = 20e6;
/// So many pieces on either side show a level.
const LEVEL: usize = 3;
/// Share of the pieces of a level that may lie on the wrong side of the middle between the levels, as those in which all was late.
const ASTRAY: f64 = 0.15;

/// When a clock was set, and by how much.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Set {
    /// How far it was set forward, ns.
    pub forward_ns: f64,
    /// In which share of the span.
    pub at: f64,
}

/// Whether the least delays of a span's equal pieces lie on two levels. Each is a device time and the delay (arrival − device time) then, ns.
pub(super) fn found(least: &[(f64, f64)]) -> Option<Set> {
    let splits = (LEVEL..least.len().saturating_sub(LEVEL)).map(|at| {
        // the clock may have been set within a piece
        let (before, after) = (&least[..at], &least[at + 1..]);
        let mut slopes: Vec<f64> = slopes(before).chain(slopes(after)).collect();
        let slope = median(&mut slopes);
        (at, slope, Level::of(before, slope), Level::of(after, slope))
    });
    let misfit = |before: &Level, after: &Level| before.misfit() + after.misfit();
    let (at, slope, before, after) = splits.min_by(|a, b| misfit(&a.2, &a.3).total_cmp(&misfit(&b.2, &b.3)))?;
    let (by_ns, middle) = (after.at - before.at, (before.at + after.at) / 2.0);
    let sure = by_ns.abs() > LEAST_NS.max(FAR * before.sd.max(after.sd))
        && before.is_beyond(middle, -by_ns)
        && after.is_beyond(middle, by_ns)
        && slope.abs() <= QUARTZ_DRIFT;
    let (first, last) = (least.first()?.0, least.last()?.0);
    sure.then(|| Set { forward_ns: -by_ns, at: (least[at].0 - first) / (last - first) })
}

/// From each piece to each later one.
fn slopes(pieces: &[(f64, f64)]) -> impl Iterator<Item = f64> + '_ {
    let from = |(at, piece): (usize, &'_ (f64, f64))| {
        let piece = *piece;
        pieces[at + 1..].iter().map(move |next| (next.1 - piece.1) / (next.0 - piece.0))
    };
    pieces.iter().enumerate().flat_map(from)
}

/// Delays of one side with the drift taken out, ns.
struct Level {
    delays: Vec<f64>,
    at: f64,
    sd: f64,
}

impl Level {
    fn of(pieces: &[(f64, f64)], slope: f64) -> Level {
        let mut delays: Vec<f64> = pieces.iter().map(|(time, delay)| delay - slope * time).collect();
        let at = median(&mut delays);
        Level { at, sd: sd_about(at, &delays), delays }
    }

    /// True where all but a few lie on the side of a value that a sign says.
    fn is_beyond(&self, value: f64, sign: f64) -> bool {
        let astray = self.delays.iter().filter(|delay| (**delay - value) * sign <= 0.0).count();
        astray as f64 <= ASTRAY * self.delays.len() as f64
    }

    fn misfit(&self) -> f64 {
        self.delays.iter().map(|delay| (delay - self.at).abs().min(MOST_NS)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sixteen pieces of 4 s with a drift and a scatter of 0.1 ms; some in which all came late.
    fn pieces(seed: u64, drift: f64, late: usize, delay_ns: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let mut dice = fastrand::Rng::with_seed(seed);
        let mut all: Vec<(f64, f64)> = (0..16)
            .map(|piece| {
                let time = 4e9 * (piece as f64 + dice.f64());
                (time, drift * time + delay_ns(piece) - 1e5 * (1.0 - dice.f64()).ln())
            })
            .collect();
        (0..late).for_each(|_| all[dice.usize(..16)].1 += 60e6 * dice.f64());
        all
    }

    #[test]
    fn a_clock_that_was_set_is_seen() {
        let mut seen = [0, 0];
        for seed in 0..100 {
            for (drift, late) in [(0.0, 0), (80e-6, 0), (0.0, 2), (-50e-6, 1)] {
                for (by_ns, at) in [(4e6, 3), (-5e6, 8), (15e6, 12), (-200e6, 4)] {
                    let found = found(&pieces(seed, drift, late, |piece| if piece > at { -by_ns } else { 0.0 }));
                    let right = |set: Set| {
                        (set.forward_ns - by_ns).abs() < 1.5e6
                            && (set.at * 16.0 - at as f64).abs() < if late == 0 { 2.5 } else { 4.0 }
                    };
                    assert!(found.is_none_or(right), "{seed} {drift} {late} {by_ns} {at}: {found:?}");
                    seen[usize::from(late > 0)] += usize::from(found.is_some());
                }
            }
        }
        assert!(seen[0] == 800 && seen[1] > 500, "{seen:?} of 800");
    }

    /// Drifts, clocks that warm up or follow the day, a line that stalls, beats of its rhythm with the device's.
    #[test]
    fn what_is_no_step_is_not_taken_for_one() {
        let (mut found_so, mut tried) = (Vec::new(), 0);
        for seed in 0..200 {
            let mut none = |what: String, drift: f64, late: usize, delay_ns: &dyn Fn(usize) -> f64| {
                tried += 1;
                found_so.extend(found(&pieces(seed, drift, late, delay_ns)).map(|set| (seed, what, drift, late, set)));
            };
            for (drift, late) in [(0.0, 0), (5e-3, 0), (0.0, 2), (-50e-6, 3)] {
                none("nothing".to_owned(), drift, late, &|_| 0.0);
                for lasts in [1.0, 2.0, 5.0, 20.0] {
                    none(format!("warms {lasts}"), drift, late, &|piece| {
                        -3e6 * (1.0 - (-(piece as f64) / lasts).exp())
                    });
                    let swings = |piece: usize| 3e6 * (piece as f64 / lasts + seed as f64).sin();
                    none(format!("swings {lasts}"), drift, late, &swings);
                }
            }
            for period in [2.3, 5.7, 9.1, 20.0] {
                none(format!("beats {period}"), 0.0, 0, &|piece| 10e6 * (1.0 - (piece as f64 / period).fract()));
            }
        }
        assert!(found_so.len() <= tried / 1000, "{} of {tried}: {found_so:?}", found_so.len());
    }

    #[test]
    fn few_pieces_say_nothing() {
        for delays in [&[][..], &[1.0], &[0.0, 0.0, 0.0, 9e6, 9e6, 9e6]] {
            let pieces: Vec<_> = delays.iter().enumerate().map(|(piece, delay)| (piece as f64, *delay)).collect();
            assert_eq!(found(&pieces), None);
        }
    }
}
