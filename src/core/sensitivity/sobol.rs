//! Sobol indices: the share of an output's variance that each parameter explains alone (first order) and with all its
//! interactions (total).
//!
//! Two samples A and B of the unit cube, and A with one column of B for each parameter (Saltelli 2002). First order by
//! Saltelli et al. (2010), Comput. Phys. Commun. 181:259-270, table 2 (b); total by Jansen (1999), table 2 (f) there.
//! The points are an Owen-scrambled Sobol sequence (Burley 2020). Intervals are percentiles of bootstrap samples of the
//! rows; of a low-discrepancy sequence they are rather too wide than too narrow.

use rayon::prelude::*;
use serde::Serialize;

use crate::sensitivity::SensitivityError;
use crate::sensitivity::error::check_count;

/// Greatest length of the sequence.
const MOST_ROWS: usize = 1 << 16;
/// Greatest number of dimensions of the sequence.
const MOST_DIMENSIONS: usize = 256;
/// Number of bootstrap samples.
const RESAMPLES: usize = 500;
/// Least number of rows for which indices are computed.
const LEAST_ROWS: usize = 16;

/// The points at which to run the model.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// Row by row: the point of A, that of B, then A with each column of B.
    pub points: Vec<Vec<f64>>,
    parameters: usize,
    seed: u64,
}

/// An index with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Index {
    /// Share of the variance.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// The indices of one parameter for one output.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Indices {
    /// First-order index.
    pub first: Index,
    /// Total index.
    pub total: Index,
}

/// The indices of all parameters for one output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Shares {
    /// Indices of each parameter; NaN if the output does not vary or too few rows have it.
    pub parameters: Vec<Indices>,
    /// Mean of the output.
    pub mean: f64,
    /// Its variance.
    pub variance: f64,
    /// Rows that have the output at all their points.
    pub used: usize,
}

/// First-order and total index of each parameter.
type Pairs = Vec<(f64, f64)>;

/// A design of `rows` rows (best a power of two) over `parameters` parameters.
///
/// # Errors
/// Too few or too many rows, or parameters.
pub fn design(parameters: usize, rows: usize, seed: u64) -> Result<Design, SensitivityError> {
    check_count("rows", rows, LEAST_ROWS..=MOST_ROWS)?;
    if parameters == 0 {
        return Err(SensitivityError::NothingVaries);
    }
    if 2 * parameters > MOST_DIMENSIONS {
        return Err(SensitivityError::TooManyParameters { parameters, most: MOST_DIMENSIONS / 2 });
    }
    let scramble = (seed ^ (seed >> 32)) as u32;
    // The middle of the float's own cell, so that no coordinate is 0 or 1.
    let half_cell = 0.5 / f64::from(1 << 24);
    let place = |row: usize, dimension: usize| {
        f64::from(sobol_burley::sample(row as u32, dimension as u32, scramble)) + half_cell
    };
    let points = (0..rows)
        .flat_map(|row| {
            let a: Vec<f64> = (0..parameters).map(|i| place(row, i)).collect();
            let b: Vec<f64> = (parameters..2 * parameters).map(|i| place(row, i)).collect();
            let mut all = vec![a.clone(), b.clone()];
            all.extend((0..parameters).map(|i| {
                let mut mixed = a.clone();
                mixed[i] = b[i];
                mixed
            }));
            all
        })
        .collect();
    Ok(Design { points, parameters, seed })
}

impl Design {
    /// Indices of each parameter for an output, from its value at each point. Rows with a value that is not finite are
    /// left out.
    ///
    /// # Panics
    /// If there is not one value per point.
    pub fn shares(&self, values: &[f64]) -> Shares {
        assert_eq!(values.len(), self.points.len(), "one value a point");
        let rows: Vec<&[f64]> =
            values.chunks(self.parameters + 2).filter(|row| row.iter().all(|v| v.is_finite())).collect();
        let (mean, variance) = moments(rows.iter().copied());
        let enough = rows.len() >= LEAST_ROWS && variance > (1e-12 * mean).powi(2);
        if !enough {
            let none = Index { value: f64::NAN, low: f64::NAN, high: f64::NAN };
            let parameters = vec![Indices { first: none, total: none }; self.parameters];
            return Shares { parameters, mean, variance, used: rows.len() };
        }
        let values = indices(&rows, self.parameters);
        let resampled: Vec<Pairs> = (0..RESAMPLES)
            .into_par_iter()
            .map(|k| {
                let mut rng = fastrand::Rng::with_seed(self.seed.wrapping_add(1 + k as u64));
                let drawn: Vec<&[f64]> = (0..rows.len()).map(|_| rows[rng.usize(..rows.len())]).collect();
                indices(&drawn, self.parameters)
            })
            .collect();
        let interval = |value: f64, of: &dyn Fn(&Pairs) -> f64| {
            let mut all: Vec<f64> = resampled.iter().map(of).filter(|v| v.is_finite()).collect();
            all.sort_by(f64::total_cmp);
            let at = |share: f64| all.get((share * (all.len() - 1) as f64).round() as usize).copied();
            let (low, high) = if all.is_empty() { (None, None) } else { (at(0.025), at(0.975)) };
            Index { value, low: low.unwrap_or(f64::NAN), high: high.unwrap_or(f64::NAN) }
        };
        let parameters = values
            .iter()
            .enumerate()
            .map(|(i, (first, total))| Indices {
                first: interval(*first, &|r| r[i].0),
                total: interval(*total, &|r| r[i].1),
            })
            .collect();
        Shares { parameters, mean, variance, used: rows.len() }
    }
}

/// Mean and variance over A and B.
fn moments<'a>(rows: impl Iterator<Item = &'a [f64]> + Clone) -> (f64, f64) {
    let both = || rows.clone().flat_map(|row| row[..2].iter());
    let n = both().count().max(1) as f64;
    let mean = both().sum::<f64>() / n;
    (mean, both().map(|v| (v - mean).powi(2)).sum::<f64>() / n)
}

/// First-order and total index of each parameter.
fn indices(rows: &[&[f64]], parameters: usize) -> Pairs {
    let (mean, variance) = moments(rows.iter().copied());
    let n = rows.len() as f64;
    (0..parameters)
        .map(|i| {
            let (mut first, mut total) = (0.0, 0.0);
            for row in rows {
                let (a, b, mixed) = (row[0], row[1], row[2 + i]);
                // About the mean: the estimator is unbiased with any constant, but least noisy with this one.
                first += (b - mean) * (mixed - a);
                total += (a - mixed).powi(2);
            }
            (first / n / variance, 0.5 * total / n / variance)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sum_has_the_shares_of_its_terms() {
        let design = design(3, 1024, 1).unwrap();
        assert_eq!(design.points.len(), 1024 * 5);
        // Variances 1/12 and 4/12.
        let values: Vec<f64> = design.points.iter().map(|x| 100.0 + x[0] + 2.0 * x[1]).collect();
        let shares = design.shares(&values);
        for (indices, share) in shares.parameters.iter().zip([0.2, 0.8, 0.0]) {
            assert!((indices.first.value - share).abs() < 0.005 && (indices.total.value - share).abs() < 0.005);
            assert!(indices.first.low <= indices.first.value && indices.first.value <= indices.first.high);
        }
        assert!((shares.mean - 101.5).abs() < 1e-3 && (shares.variance - 5.0 / 12.0).abs() < 1e-3);
    }

    #[test]
    fn gaps_are_left_out_and_constants_have_no_shares() {
        let design = design(2, 256, 1).unwrap();
        let mut values: Vec<f64> = design.points.iter().map(|x| x[0]).collect();
        values[5] = f64::NAN;
        let shares = design.shares(&values);
        assert_eq!(shares.used, 255);
        assert!((shares.parameters[0].total.value - 1.0).abs() < 0.02);
        assert!(design.shares(&vec![3.0; values.len()]).parameters[0].first.value.is_nan());
        assert!(design.shares(&vec![f64::NAN; values.len()]).parameters[1].total.high.is_nan());
    }

    #[test]
    fn sizes_are_refused_that_the_sequence_does_not_have() {
        assert!(design(2, 70_000, 1).unwrap_err().to_string().contains("'rows' = 70000: it must be from 16 to 65536"));
        assert!(design(200, 64, 1).unwrap_err().to_string().contains("128"));
        assert!(design(0, 64, 1).is_err());
    }
}
