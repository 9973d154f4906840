//! The likelihood of a disturbance that is white noise and a part that slowly forgets itself.

/// Correlation times that are tried are this factor apart, from a sample to the whole record; so is the share of the
/// slow part's variance, over this range on either side of one, as natural logarithms.
const FACTOR: f64 = 2.0;
const SHARES: f64 = 14.0;

/// Natural logarithm of the greatest likelihood of residuals of mean zero, taken at even times, as the sum of white
/// noise and of a process of first order, `x_{k+1} = φ x_k + w_k`, over the variances of both and `φ`: by the innovations
/// of a Kalman filter (Harvey 1989, Forecasting, Structural Time Series Models and the Kalman Filter, 3.4), without the
/// constant of the normal density.
pub(crate) fn log_likelihood(residual: &[f64]) -> f64 {
    let memories = std::iter::successors(Some(1.0), |m| Some(m * FACTOR)).take_while(|m| *m < residual.len() as f64);
    let shares = std::iter::successors(Some(-SHARES), |s| Some(s + FACTOR.ln())).take_while(|s| *s <= SHARES);
    let all = shares.flat_map(|share| memories.clone().map(move |memory| (memory, share.exp())));
    all.map(|(memory, share)| with(residual, (-1.0 / memory).exp(), share)).fold(f64::NEG_INFINITY, f64::max)
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

    /// White noise has the likelihood of its own variance; a slow part is seen, and the likelihood is that of the exact
    /// covariance.
    #[test]
    fn it_is_the_normal_density_of_the_exact_covariance() {
        use nalgebra::{DMatrix, DVector};
        let mut gauss = Gauss::new(7);
        let (mut slow, n) = (0.0, 60);
        let series: Vec<f64> = (0..n)
            .map(|_| {
                slow = 0.9 * slow + gauss.next();
                slow + gauss.next()
            })
            .collect();
        let (kept, share) = (0.9f64, 3.0);
        let covariance =
            DMatrix::from_fn(n, n, |i, j| share * kept.powi(i.abs_diff(j) as i32) + if i == j { 1.0 } else { 0.0 });
        let y = DVector::from_column_slice(&series);
        let factor = covariance.cholesky().unwrap();
        let square = y.dot(&factor.solve(&y));
        let log_determinant = 2.0 * factor.l().diagonal().map(f64::ln).sum();
        let exact = -0.5 * (n as f64 * (square / n as f64).ln() + log_determinant + n as f64);
        assert!((with(&series, kept, share) - exact).abs() < 1e-9, "{} {exact}", with(&series, kept, share));
        let white: Vec<f64> = (0..4000).map(|_| 0.2 * gauss.next()).collect();
        let variance = white.iter().map(|v| v * v).sum::<f64>() / 4000.0;
        let alone = -2000.0 * (variance.ln() + 1.0);
        assert!((log_likelihood(&white) - alone).abs() < 6.0, "{} {alone}", log_likelihood(&white));
    }
}
