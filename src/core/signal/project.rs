//! Small linear least squares: how much of a signal a few columns explain, and with which weight the last of them.

use crate::product::dot;

/// Orthonormal basis of some columns, computed once and applied to many signals of the same length.
pub(crate) struct Projector {
    basis: Vec<Vec<f64>>,
    /// Norm of the last column after removing the others from it.
    last_norm: f64,
}

/// What a projection leaves.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Residual {
    /// Sum of squares after removing the first `background` columns.
    pub background: f64,
    /// Sum of squares after removing all columns.
    pub all: f64,
    /// Weight of the last column.
    pub gain: f64,
    /// As `all`, over both, if the last column is as noisy as the signal (total least squares; Golub & Van Loan 1980,
    /// SIAM J. Numer. Anal. 17, 883).
    pub both: f64,
}

impl Projector {
    /// `None` if the columns are linearly dependent (a constant template, too few samples).
    pub fn new(columns: Vec<Vec<f64>>) -> Option<Projector> {
        let mut basis: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
        let mut last_norm = 0.0;
        for mut column in columns {
            let before = dot(&column, &column).sqrt();
            for _ in 0..2 {
                for q in &basis {
                    let part = dot(&column, q);
                    column.iter_mut().zip(q).for_each(|(c, q)| *c -= part * q);
                }
            }
            last_norm = dot(&column, &column).sqrt();
            if last_norm.is_nan() || last_norm <= 1e-9 * before || basis.len() >= column.len() {
                return None;
            }
            column.iter_mut().for_each(|c| *c /= last_norm);
            basis.push(column);
        }
        Some(Projector { basis, last_norm })
    }

    /// Projects a signal; its first `background` columns are the ones that need no explanation (level, slope).
    pub fn residual(&self, signal: &[f64], background: usize) -> Residual {
        // about the first value, or the squares of a large constant head swallow the digits of a small residual
        let origin = signal.first().copied().unwrap_or(0.0);
        let signal: Vec<f64> = signal.iter().map(|y| y - origin).collect();
        let total = dot(&signal, &signal);
        let mut left = total;
        let (mut after_background, mut last_part) = (total, 0.0);
        for (i, q) in self.basis.iter().enumerate() {
            let part = dot(&signal, q);
            left = (left - part * part).max(1e-15 * total);
            if i + 1 == background {
                after_background = left;
            }
            last_part = part;
        }
        // The lesser eigenvalue of [[tt, ty], [ty, yy]], where t and y are what the other columns leave of the last
        // column and of the signal.
        let (tt, yy, ty) = (self.last_norm.powi(2), left + last_part * last_part, last_part * self.last_norm);
        let both = 2.0 * tt * left / (tt + yy + ((tt - yy).powi(2) + 4.0 * ty * ty).sqrt());
        Residual { background: after_background, all: left, gain: last_part / self.last_norm, both }
    }
}

/// Minimum of a profile of sums of squares over an even grid, by a parabola through its lowest points, and its half
/// width at a rise by `variance` (the one-standard-error interval of the profile likelihood); both in grid steps.
pub(crate) fn profile_minimum(sums: &[f64], lowest: usize, variance: f64) -> (f64, f64) {
    let limit = sums[lowest] + variance;
    let reach = |mut steps: Box<dyn Iterator<Item = usize>>| -> f64 {
        let mut before = (lowest, sums[lowest]);
        steps
            .find_map(|i| {
                if sums[i] >= limit {
                    let part = (limit - before.1) / (sums[i] - before.1);
                    return Some((before.0 as f64 + part * (i as f64 - before.0 as f64) - lowest as f64).abs());
                }
                before = (i, sums[i]);
                None
            })
            .unwrap_or_else(|| (before.0 as f64 - lowest as f64).abs().max(1.0))
    };
    let width = 0.5 * (reach(Box::new((0..lowest).rev())) + reach(Box::new(lowest + 1..sums.len())));
    let mut shift = 0.0;
    if lowest > 0 && lowest + 1 < sums.len() {
        let (a, b, c) = (sums[lowest - 1], sums[lowest], sums[lowest + 1]);
        let bend = a - 2.0 * b + c;
        if bend > 0.0 && bend.is_finite() {
            shift = (0.5 * (a - c) / bend).clamp(-0.5, 0.5);
        }
    }
    (lowest as f64 + shift, width)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_of_the_last_column_is_found() {
        let ramp: Vec<f64> = (0..20).map(f64::from).collect();
        let bump: Vec<f64> = (0..20).map(|i| (-0.1 * f64::from(i - 9).powi(2)).exp()).collect();
        let signal: Vec<f64> = ramp.iter().zip(&bump).map(|(r, b)| 500.0 + 3.0 * r - 2.5 * b).collect();
        let projector = Projector::new(vec![vec![1.0; 20], ramp, bump]).unwrap();
        let residual = projector.residual(&signal, 2);
        assert!((residual.gain + 2.5).abs() < 1e-9, "{residual:?}");
        assert!(residual.all < 1e-9 * residual.background);
        assert!(Projector::new(vec![vec![1.0; 20], vec![2.0; 20]]).is_none());
    }

    #[test]
    fn a_parabola_gives_its_minimum_and_width() {
        let sums: Vec<f64> = (0..21).map(|i| 5.0 + 0.25 * (f64::from(i) - 9.3).powi(2)).collect();
        let (at, width) = profile_minimum(&sums, 9, 1.0);
        assert!((at - 9.3).abs() < 1e-9);
        assert!((width - 2.0).abs() < 0.1, "{width}"); // 0.25 w² = 1
    }
}
