//! The broad shape of a noise's spectrum: a first-order autoregression and white noise,
//! `S(ω) ∝ d²/(d² + 2φ(1 - cos ω)) + g`, `d = 1 - φ`.
//!
//! Averages over frequencies flatten a spectrum that is steep within them. They do not flatten its ratio to a similar
//! shape, and the shape multiplied back gives an estimate with the bias of that ratio (multiplicative bias correction:
//! Hjort & Glad 1995, Ann. Statist. 23, 882; of spectra, Xiao & Linton 2002, J. Time Ser. Anal. 23, 215). The shape is
//! the likeliest by Whittle (1953, Ark. Mat. 2, 423) of a grid, less one for each of its parameters (Akaike 1974, IEEE
//! Trans. Autom. Control 19, 716): noise that is hardly slower than white stays white.

use crate::fit::inference::thresholds::{BAND_SHARE, SHAPES_PER_DECADE, SLOWEST_DECADE, WHITE_DECADES};

/// A part of a periodogram.
struct Band {
    /// Independent frequencies in it.
    count: f64,
    mean: f64,
    /// `2(1 - cos ω)` in its middle.
    chord: f64,
}

/// The shape at each frequency of a periodogram whose frequencies are `oversampled` times as many as are independent.
pub(crate) fn shape(periodogram: &[f64], oversampled: f64) -> Vec<f64> {
    let last = periodogram.len() - 1;
    let chord = |k: f64| 2.0 * (1.0 - (std::f64::consts::PI * k / last as f64).cos());
    let bands = bands(periodogram, oversampled, &chord);
    let decades = |from: i32, to: i32| {
        (from * SHAPES_PER_DECADE..=to * SHAPES_PER_DECADE)
            .map(|i| 10f64.powf(f64::from(i) / f64::from(SHAPES_PER_DECADE)))
    };
    // A correlation that outlasts the record moves none of its frequencies.
    let slowest = 0.5 * std::f64::consts::PI * oversampled / last as f64;
    let flat = (1.0, 0.0);
    let mut best = (minus_log_likelihood(&bands, flat), flat);
    for d in decades(SLOWEST_DECADE, 0).filter(|d| (slowest..1.0).contains(d)) {
        for white in std::iter::once(0.0).chain(decades(WHITE_DECADES.0, WHITE_DECADES.1)).map(|w| w * d) {
            let parameters = if white > 0.0 { 2.0 } else { 1.0 };
            let unlikely = minus_log_likelihood(&bands, (d, white)) + parameters;
            if unlikely < best.0 {
                best = (unlikely, (d, white));
            }
        }
    }
    (0..=last).map(|k| at(best.1, chord(k as f64))).collect()
}

fn at((d, white): (f64, f64), chord: f64) -> f64 {
    d * d / (d * d + (1.0 - d) * chord) + white
}

/// Whittle's, with the scale that suits best.
fn minus_log_likelihood(bands: &[Band], shape: (f64, f64)) -> f64 {
    let (mut count, mut logs, mut ratio) = (0.0, 0.0, 0.0);
    for band in bands {
        let expected = at(shape, band.chord);
        count += band.count;
        logs += band.count * expected.ln();
        ratio += band.count * band.mean / expected;
    }
    if ratio > 0.0 { logs + count * (ratio / count).ln() } else { f64::NEG_INFINITY }
}

/// From half an independent frequency on: at none at all a fit has left nothing.
fn bands(periodogram: &[f64], oversampled: f64, chord: &dyn Fn(f64) -> f64) -> Vec<Band> {
    let (last, mut from, mut bands) =
        (periodogram.len() - 1, (0.5 * oversampled).round().max(1.0) as usize, Vec::new());
    while from < last {
        let width = (BAND_SHARE * from as f64).max(oversampled).round().max(1.0) as usize;
        let to = (from + width).min(last);
        let (count, n) = ((to - from) as f64 / oversampled, (to - from) as f64);
        let mean = periodogram[from..to].iter().sum::<f64>() / n;
        bands.push(Band { count, mean, chord: chord(from as f64 + 0.5 * (n - 1.0)) });
        from = to;
    }
    bands
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the expected spectrum of noise that is on the grid the shape is that spectrum; of a flat one it is flat, and
    /// so it is of nothing.
    #[test]
    fn a_shape_on_the_grid_is_found() {
        for true_shape in [(0.01, 0.01), (10f64.powf(-2.5), 0.0), (1.0, 0.0)] {
            let expected: Vec<f64> = (0..=8192)
                .map(|k| 7.0 * at(true_shape, 2.0 - 2.0 * (std::f64::consts::PI * f64::from(k) / 8192.0).cos()))
                .collect();
            let found = shape(&expected, 2.7);
            let ratios = || expected.iter().zip(&found).map(|(e, f)| e / f / (expected[0] / found[0]));
            assert!(ratios().all(|r| (0.98..1.02).contains(&r)), "{true_shape:?}");
        }
        assert!(shape(&[0.0; 65], 2.0).iter().all(|s| *s == 1.0));
    }
}
