//! The likelihood of a disturbance that is white noise and a part that slowly forgets itself.

/// Correlation times that are tried first are about so far apart, as natural logarithms, from a sample to the whole
/// record; so is the share of the slow part's variance, over this range on either side of one.
const APART: f64 = 2.5;
const SHARES: f64 = 14.0;
/// Then the distance is halved so often.
const HALVINGS: usize = 3;

/// Natural logarithm of the greatest likelihood of residuals of mean zero, taken at even times, as the sum of white
/// noise and of a process of first order, `x_{k+1} = φ x_k + w_k`, over the variances of both and `φ`: by the innovations
/// of a Kalman filter (Harvey 1989, Forecasting, Structural Time Series Models and the Kalman Filter, 3.4), without the
/// constant of the normal density. From the best of a coarse lattice it climbs in ever smaller steps (Hooke & Jeeves
/// 1961, J. ACM 8, 212).
pub(crate) fn log_likelihood(residual: &[f64]) -> f64 {
    let longest = (residual.len().max(2) as f64).ln();
    let at = |memory: f64, share: f64| (with(residual, (-(-memory).exp()).exp(), share.exp()), memory, share);
    let higher = |a: (f64, f64, f64), b: (f64, f64, f64)| if b.0 > a.0 { b } else { a };
    let lattice = even(0.0, longest).flat_map(|memory| even(-SHARES, SHARES).map(move |share| (memory, share)));
    let mut best = lattice.map(|(memory, share)| at(memory, share)).fold((f64::NEG_INFINITY, 0.0, 0.0), higher);
    let mut step = APART;
    for _ in 0..HALVINGS {
        step *= 0.5;
        loop {
            let (_, memory, share) = best;
            let around = [-step, 0.0, step].map(|m| [-step, 0.0, step].map(|s| (memory + m, share + s)));
            let around = around.as_flattened().iter().filter(|near| **near != (memory, share));
            let inside = around.map(|(m, s)| at(m.clamp(0.0, longest), s.clamp(-SHARES, SHARES)));
            let next = inside.fold(best, higher);
            if next.0 <= best.0 {
                break;
            }
            best = next;
        }
    }
    best.0
}

/// Values from the lowest to the highest, no farther apart than [`APART`].
fn even(low: f64, high: f64) -> impl Iterator<Item = f64> {
    let steps = ((high - low) / APART).ceil().max(1.0);
    (0..=steps as u32).map(move |i| low + (high - low) * f64::from(i) / steps)
}

/// The same at one `φ` and one variance of the slow part over that of the white part, the greatest over their scale.
fn with(residual: &[f64], kept: f64, share: f64) -> f64 {
    let new = share * (1.0 - kept * kept);
    let (mut state, mut variance) = (0.0, share);
    let (mut square, mut determinant) = (0.0, 0.0);
    let mut product = 1.0;
    for &value in residual {
        let (off, of_off) = (value - state, variance + 1.0);
        let gain = variance / of_off;
        square += off * off / of_off;
        state = kept * (state + gain * off);
        variance = kept * kept * variance * (1.0 - gain) + new;
        // one logarithm for many factors
        product *= of_off;
        if !(1e-200..1e200).contains(&product) {
            determinant += product.ln();
            product = 1.0;
        }
    }
    let n = residual.len() as f64;
    -0.5 * (n * (square / n).max(f64::MIN_POSITIVE).ln() + determinant + product.ln() + n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::testing::Gauss;

    /// Natural logarithm of the density by the exact covariance, as [`with`].
    fn exact(series: &[f64], kept: f64, share: f64) -> f64 {
        use nalgebra::{DMatrix, DVector};
        let n = series.len();
        let covariance =
            DMatrix::from_fn(n, n, |i, j| share * kept.powi(i.abs_diff(j) as i32) + if i == j { 1.0 } else { 0.0 });
        let y = DVector::from_column_slice(series);
        let factor = covariance.cholesky().unwrap();
        let square = y.dot(&factor.solve(&y));
        let log_determinant = 2.0 * factor.l().diagonal().map(f64::ln).sum();
        -0.5 * (n as f64 * (square / n as f64).ln() + log_determinant + n as f64)
    }

    /// White noise beside a part that keeps so much from sample to sample.
    fn series(gauss: &mut Gauss, n: usize, kept: f64, slow: f64) -> Vec<f64> {
        let mut state = 0.0;
        let mut next = || {
            state = kept * state + slow * gauss.next();
            state + gauss.next()
        };
        (0..n).map(|_| next()).collect()
    }

    #[test]
    fn it_is_the_normal_density_of_the_exact_covariance() {
        let series = series(&mut Gauss::new(7), 60, 0.9, 1.0);
        let (found, exact) = (with(&series, 0.9, 3.0), exact(&series, 0.9, 3.0));
        assert!((found - exact).abs() < 1e-9, "{found} {exact}");
    }

    /// No number of a fine lattice is more probable by the exact covariance than what is found, whether the noise is
    /// white, forgets itself soon or late, or never.
    #[test]
    fn nothing_is_more_probable_than_what_is_found() {
        for (seed, (kept, slow)) in (1..).zip([(0.0, 0.0), (0.5, 1.0), (0.9, 1.0), (0.9, 30.0), (1.0, 0.3)]) {
            let series = series(&mut Gauss::new(seed), 40, kept, slow);
            let memories = (0..13).map(|i| (0.3 * f64::from(i)).exp());
            let all = memories.flat_map(|memory| (-46..=46).map(move |i| (memory, (0.3 * f64::from(i)).exp())));
            let most = all.map(|(memory, share)| exact(&series, (-1.0 / memory).exp(), share));
            let most = most.fold(f64::NEG_INFINITY, f64::max);
            let found = log_likelihood(&series);
            assert!(found > most - 0.05, "{kept} {slow}: {found} {most}");
        }
    }

    #[test]
    fn white_noise_has_the_likelihood_of_its_own_variance() {
        let mut gauss = Gauss::new(7);
        let white: Vec<f64> = (0..4000).map(|_| 0.2 * gauss.next()).collect();
        let variance = white.iter().map(|v| v * v).sum::<f64>() / 4000.0;
        let alone = -2000.0 * (variance.ln() + 1.0);
        assert!((log_likelihood(&white) - alone).abs() < 6.0, "{} {alone}", log_likelihood(&white));
    }
}
