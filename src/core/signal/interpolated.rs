//! Samples that were not measured but drawn between others: a curve read off a figure, a logger that fills in.
//!
//! On the straight lines between such points the second differences are those of rounding, at the points they are not.
//! So a record whose second differences are hardly ever anything, but now and then a corner by itself, was
//! interpolated. (A front of a quiet or noise-free record is no such corner: there are few of them, or they last for
//! many samples.) Its scatter from sample to sample says nothing; what says something is how far each corner lies from
//! the line between the corners beside it.

use crate::robust::{MEDIAN_TO_SD, median};

/// A second difference this many times the median one belongs to no straight line; the median is that of rounding.
const OFF_THE_LINE: f64 = 8.0;
/// The typical corner is this much sharper than what still counts as straight: no noise reaches that.
const SHARP: f64 = 10.0;
/// Most samples of a corner: two where it lies between them.
const LONGEST_CORNER: usize = 2;
/// Least number of corners, and least share of the samples that they make up: a noise-free record has two corners a
/// front.
const FEWEST: usize = 30;
const LEAST_SHARE: f64 = 0.03;

/// The points between which a record was interpolated: their number per sample, and the standard deviation of their
/// noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corners {
    /// Corners per sample.
    pub share: f64,
    /// By how much a corner leaves the line between its neighbours, less what that owes to these, m.
    pub sd_m: f64,
}

/// The corners of a record that was interpolated; none of one that was not. `quantum` is the step of its grid.
pub(crate) fn corners(whole: &[f64], quantum: Option<f64>) -> Option<Corners> {
    let second: Vec<f64> = whole.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).collect();
    let rounding = median(&mut second.clone()).max(quantum.unwrap_or(0.0)).max(f64::MIN_POSITIVE);
    let straight = OFF_THE_LINE * rounding;
    // each corner with the sharpest of its samples
    let (mut places, mut sharpness, mut alone) = (vec![0], Vec::new(), 0);
    for group in second.iter().enumerate().collect::<Vec<_>>().chunk_by(|a, b| (*a.1 > straight) == (*b.1 > straight)) {
        if *group[0].1 <= straight {
            continue;
        }
        if group.len() > LONGEST_CORNER {
            // a steep stretch: each of its samples is as good as a point
            places.extend(group.iter().map(|(i, _)| i + 1));
            continue;
        }
        let sharpest = group.iter().max_by(|a, b| a.1.total_cmp(b.1))?;
        places.push(sharpest.0 + 1);
        sharpness.push(*sharpest.1);
        alone += 1;
    }
    places.push(whole.len().checked_sub(1)?);
    let share = alone as f64 / whole.len() as f64;
    if alone < FEWEST || share < LEAST_SHARE || median(&mut sharpness) < SHARP * straight {
        return None;
    }
    Some(Corners { share: places.len() as f64 / whole.len() as f64, sd_m: scatter(whole, &places) })
}

/// The noise of points: how far each lies from the line between its neighbours. The median ignores fronts.
fn scatter(whole: &[f64], places: &[usize]) -> f64 {
    let off = |w: &[usize]| {
        let [from, at, to] = [w[0], w[1], w[2]];
        let part = (at - from) as f64 / (to - from) as f64;
        let line = (1.0 - part) * whole[from] + part * whole[to];
        (whole[at] - line).abs() / (1.0 + part * part + (1.0 - part).powi(2)).sqrt()
    };
    let mut off: Vec<f64> = places.windows(3).filter(|w| w[0] < w[1] && w[1] < w[2]).map(off).collect();
    MEDIAN_TO_SD * median(&mut off)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::testing::Gauss;

    /// Straight lines between points `(sample, head)`, read off at whole samples.
    fn between(points: &[(f64, f64)]) -> Vec<f64> {
        let last = points[points.len() - 1].0 as usize;
        let at = |i: usize| {
            let k = points.partition_point(|p| p.0 <= i as f64).clamp(1, points.len() - 1);
            let (a, b) = (points[k - 1], points[k]);
            // printed to the tenth of a millimetre
            ((a.1 + (b.1 - a.1) * (i as f64 - a.0) / (b.0 - a.0)) * 1e4).round() / 1e4
        };
        (0..=last).map(at).collect()
    }

    fn wave(t: f64) -> f64 {
        40.0 + 30.0 * if (t / 700.0).fract() < 0.5 { 1.0 } else { -1.0 }
    }

    #[test]
    fn a_curve_read_off_a_figure_has_the_noise_of_its_points() {
        let mut gauss = Gauss::new(3);
        let mut time = 0.0;
        let points: Vec<(f64, f64)> = (0..200)
            .map(|_| {
                time += 6.0 + 2.0 * gauss.next().clamp(-2.0, 2.0);
                (time - 6.0, wave(time) + 0.4 * gauss.next())
            })
            .collect();
        let found = corners(&between(&points), None).unwrap();
        assert!((0.25..0.6).contains(&found.sd_m), "{found:?}");
        assert!((0.1..0.25).contains(&found.share), "{found:?}");
    }

    /// A logger that fills in nine samples between two.
    #[test]
    fn what_a_logger_fills_in_has_the_noise_of_what_it_measured() {
        let mut gauss = Gauss::new(4);
        let points: Vec<(f64, f64)> =
            (0..400).map(|k| (10.0 * f64::from(k), wave(10.0 * f64::from(k)) + 0.05 * gauss.next())).collect();
        let found = corners(&between(&points), None).unwrap();
        assert!((found.sd_m / 0.05 - 1.1).abs() < 0.25 && (found.share - 0.1).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn what_was_measured_or_simulated_has_no_corners() {
        let mut gauss = Gauss::new(5);
        let noisy: Vec<f64> = (0..4000).map(|i| wave(f64::from(i)) + 0.03 * gauss.next()).collect();
        let coarse: Vec<f64> = noisy.iter().map(|h| (h / 0.1).round() * 0.1).collect();
        // packed line, creeping wall: nowhere straight, and fronts now and then
        let smooth: Vec<f64> = (0..4000).map(|i| wave(f64::from(i)) * (-f64::from(i) / 2000.0).exp()).collect();
        for record in [noisy, coarse.clone(), smooth] {
            assert_eq!(corners(&record, None), None);
        }
        assert_eq!(corners(&coarse, Some(0.1)), None);
        assert_eq!((corners(&[], None), corners(&[1.0; 500], None)), (None, None));
    }
}
