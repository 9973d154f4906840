//! The covariance of fitted variables, from all known disturbances.
//!
//! `C = A M A` with `A = (JᵀJ)⁻¹` and `M` the covariance of `Jᵀr`: that of autocorrelated noise (see
//! [`crate::fit::inference::noise_autocorrelation`]), of priors, and of the errors that an instrument makes in all its
//! samples alike, whose size is known but whose value is not fitted (Jazwinski 1970, Stochastic Processes and Filtering
//! Theory, sec. 8.4; "consider" covariance). Where the noise is white and as large as believed, and nothing else
//! disturbs, `C = A`.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::fit::inference::noise_autocorrelation::score_covariances;
use crate::fit::inference::thresholds::DECAYED_NOISE_SHARE;
use crate::fit::numeric::uncertainty::{Normal, determined_inverse};
use crate::fit::problem::rows::CommonError;
use crate::product::{dot, gram};

/// A linearised fit.
#[derive(Debug, Clone, Copy)]
pub struct Linearised<'a> {
    /// Derivative of the residuals, a column a variable.
    pub columns: &'a [Vec<f64>],
    /// Residuals: those of each record, then those of priors and meters.
    pub residuals: &'a [f64],
    /// Records, each an instrument's samples one after the other, grouped by what was sampled together.
    pub records: &'a [Vec<Range<usize>>],
    /// Errors of instruments that all their samples share.
    pub common: &'a [CommonError],
    /// Variables that are held at a bound.
    pub at_bound: &'a [bool],
    /// Where records are compared as something else than the samples that contain the noise, the same derivatives and
    /// residuals seen from the samples (`Bᵀ` of columns that compare `B r`), with the samples' records; otherwise none.
    pub in_time: Option<InTime<'a>>,
}

/// See [`Linearised::in_time`].
#[derive(Debug, Clone, Copy)]
pub struct InTime<'a> {
    /// A column a variable.
    pub columns: &'a [Vec<f64>],
    /// Residuals of the samples.
    pub residuals: &'a [f64],
    /// Records among them.
    pub records: &'a [Vec<Range<usize>>],
}

/// A series of noise for each record of each group, at the rate of its samples.
pub type Noise = [Vec<Vec<f64>>];

/// What the errors of any of the variables follow from.
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    /// `JᵀJ`.
    normal: DMatrix<f64>,
    /// Covariance of `Jᵀr` from noise and priors.
    scores: DMatrix<f64>,
    /// What one standard deviation of each common error adds to `Jᵀr`.
    common: Vec<Vec<f64>>,
}

impl Linearised<'_> {
    /// Its moments where the residuals show the noise, or another series does.
    pub fn moments(&self, noise: Option<&Noise>) -> Moments {
        let [moments] = self.moments_of([noise]);
        moments
    }

    /// The same for several noises at once: most of the work is the columns' alone.
    pub fn moments_of<const N: usize>(&self, noises: [Option<&Noise>; N]) -> [Moments; N] {
        let (columns, residuals, records) = match self.in_time {
            None => (self.columns, self.residuals, self.records),
            Some(time) => (time.columns, time.residuals, time.records),
        };
        let own = |group: &Vec<Range<usize>>| group.iter().map(|rows| &residuals[rows.clone()]).collect();
        let series = noises.map(|noise| match noise {
            None => records.iter().map(own).collect::<Vec<Vec<&[f64]>>>(),
            Some(noise) => noise.iter().map(|group| group.iter().map(|series| &series[..]).collect()).collect(),
        });
        let columns: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
        let mut by_noise = score_covariances(&columns, records, &series).into_iter();
        let n = self.columns.len();
        let samples = self.records.iter().flatten().map(|r| r.end).max().unwrap_or(0);
        let others: Vec<&[f64]> = self.columns.iter().map(|c| &c[samples..]).collect();
        let others = gram(&others);
        let moved = |c: &Vec<f64>, common: &CommonError| {
            common.iter().map(|(first, by)| dot(&c[*first..first + by.len()], by)).sum::<f64>()
        };
        let common: Vec<Vec<f64>> =
            self.common.iter().map(|common| self.columns.iter().map(|c| moved(c, common)).collect()).collect();
        let normal = gram(self.columns);
        noises.map(|_| Moments {
            normal: normal.clone(),
            scores: by_noise.next().unwrap_or_else(|| DMatrix::zeros(n, n)) + &others,
            common: common.clone(),
        })
    }

    /// Whether the noise from `before` the closure has died away in the residuals, for each group of records. While the
    /// valve closed it was still there, and limits what only the closure shows.
    pub(crate) fn decayed(&self, before: &Noise) -> Vec<bool> {
        let left = self.left().into_iter().zip(before);
        left.map(|(left, before)| mean_square(&left) < DECAYED_NOISE_SHARE * mean_square(before)).collect()
    }

    /// The noise that counts in each group of records: that of `before` where it has `decayed`, the residuals
    /// elsewhere.
    pub(crate) fn noise_that_counts(&self, before: &Noise, decayed: &[bool]) -> Vec<Vec<Vec<f64>>> {
        let groups = self.left().into_iter().zip(before).zip(decayed);
        groups.map(|((left, before), decayed)| if *decayed { before.clone() } else { left }).collect()
    }

    /// The residuals of the samples of each record.
    fn left(&self) -> Vec<Vec<Vec<f64>>> {
        let (residuals, records) = match self.in_time {
            None => (self.residuals, self.records),
            Some(time) => (time.residuals, time.records),
        };
        let of = |group: &Vec<Range<usize>>| group.iter().map(|rows| residuals[rows.clone()].to_vec()).collect();
        records.iter().map(of).collect()
    }
}

fn mean_square(series: &[Vec<f64>]) -> f64 {
    let values = series.iter().flatten();
    values.clone().map(|v| v * v).sum::<f64>() / values.count().max(1) as f64
}

/// Covariances of the variables. Rows and columns of variables at a bound are zero; a variable that the data leave open
/// has an infinite variance.
#[derive(Debug, Clone, PartialEq)]
pub struct Errors {
    /// `C`.
    pub covariance: DMatrix<f64>,
    /// `A`: what `C` would be with white noise as large as believed, and nothing else.
    pub believed: DMatrix<f64>,
    /// The part of `C` from noise and priors, over the combinations that the data determine: the others move nothing at
    /// the samples.
    pub by_noise: DMatrix<f64>,
    /// Sum of squares that the fit takes from noise and priors, `tr(A M)`: one for each variable where all is as
    /// believed.
    pub taken: f64,
}

impl Errors {
    /// Of a linearised fit whose residuals show its noise.
    pub fn of(fit: Linearised) -> Self {
        Self::among(&fit.moments(None), fit.at_bound)
    }

    /// Of the variables that are not at a bound.
    pub fn among(moments: &Moments, at_bound: &[bool]) -> Self {
        let all = at_bound.len();
        let Normal { free, scale, matrix } = Normal::among(&moments.normal, at_bound);
        let (inverse, open) = determined_inverse(matrix);
        let mut scores = DMatrix::from_fn(free.len(), free.len(), |a, b| moments.scores[(free[a], free[b])]);
        let sandwich = |scores: &DMatrix<f64>| {
            let scaled = DMatrix::from_fn(free.len(), free.len(), |a, b| scores[(a, b)] / (scale[a] * scale[b]));
            &inverse * scaled * &inverse
        };
        let spread = |m: &DMatrix<f64>, unknown: f64| {
            let mut out = DMatrix::zeros(all, all);
            for (a, &i) in free.iter().enumerate() {
                for (b, &j) in free.iter().enumerate() {
                    let unknown = if a == b { unknown } else { 0.0 };
                    let known = m[(a, b)] / (scale[a] * scale[b]);
                    out[(i, j)] = if (open[a] || open[b]) && unknown > 0.0 { unknown } else { known };
                }
            }
            out
        };
        let taken = (0..free.len()).flat_map(|a| (0..free.len()).map(move |b| (a, b)));
        let taken = taken.map(|(a, b)| inverse[(a, b)] * scores[(b, a)] / (scale[a] * scale[b])).sum();
        let by_noise = spread(&sandwich(&scores), 0.0);
        for by in &moments.common {
            scores += DMatrix::from_fn(free.len(), free.len(), |a, b| by[free[a]] * by[free[b]]);
        }
        let (covariance, believed) = (spread(&sandwich(&scores), f64::INFINITY), spread(&inverse, f64::INFINITY));
        Errors { covariance, believed, by_noise, taken }
    }

    /// Adds an error whose size in each variable is known.
    pub fn and(mut self, of_each: &[f64]) -> Self {
        let n = of_each.len();
        // A variable at a bound does not move, and what is infinite stays so.
        let moved = |j: usize| if self.covariance[(j, j)] > 0.0 { of_each[j] } else { 0.0 };
        self.covariance += DMatrix::from_fn(n, n, |i, j| moved(i) * moved(j));
        self
    }

    /// Standard error of variable `j`: NaN at a bound, infinite where the data leave it open.
    pub fn of_variable(&self, j: usize) -> f64 {
        let variance = self.covariance[(j, j)];
        if variance == 0.0 { f64::NAN } else { variance.sqrt() }
    }

    /// How much more a variable scatters than with the noise as believed: the factor by which a rise of the sum of
    /// squares along it counts less (Kent 1982, Biometrika 69, 19). Not below 1.
    pub fn inflation(&self, j: usize) -> f64 {
        let ratio = self.covariance[(j, j)] / self.believed[(j, j)];
        if ratio.is_finite() { ratio.max(1.0) } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn white(n: usize, seed: u64) -> Vec<f64> {
        let mut random = fastrand::Rng::with_seed(seed);
        (0..n)
            .map(|_| (-2.0 * (1.0 - random.f64()).ln()).sqrt() * (std::f64::consts::TAU * random.f64()).cos())
            .collect()
    }

    fn errors(
        columns: &[Vec<f64>],
        residuals: &[f64],
        samples: usize,
        common: &[CommonError],
        at_bound: &[bool],
    ) -> Errors {
        let record = 0..samples;
        Errors::of(Linearised { columns, residuals, records: &[vec![record]], common, at_bound, in_time: None })
    }

    /// y = m + e, σ = 1, n = 400: 1/20; with a gauge that is off by 0.3 in all samples, √(1/400 + 0.09).
    #[test]
    fn the_mean_of_white_noise_has_the_textbook_error_and_a_gauges_own_on_top() {
        let (ones, noise) = (vec![vec![1.0; 400]], white(400, 1));
        let alone = errors(&ones, &noise, 400, &[], &[false]);
        assert!((alone.of_variable(0) * 20.0 - 1.0).abs() < 0.15, "{}", alone.of_variable(0));
        assert!((alone.believed[(0, 0)] * 400.0 - 1.0).abs() < 1e-12);
        let gauge = errors(&ones, &noise, 400, &[vec![(0, vec![0.3; 400])]], &[false]);
        let expected = (alone.covariance[(0, 0)] + 0.09).sqrt();
        assert!((gauge.of_variable(0) - expected).abs() < 1e-12, "{}", gauge.of_variable(0));
    }

    /// A line through n points known to σ: at the mean of the abscissas the curve is known to σ/√n, at an end to twice
    /// that. Where the same column stands twice the data do not separate the two, but determine their sum.
    #[test]
    fn the_covariance_of_a_line_is_the_textbooks_and_leaves_out_what_is_open() {
        let n = 1001;
        let x: Vec<f64> = (0..n).map(|i| f64::from(i) / 500.0 - 1.0).collect();
        let nothing = vec![0.0; n as usize];
        let of = |columns: &[Vec<f64>], held: bool| errors(columns, &nothing, n as usize, &[], &[held; 2]);
        let line = of(&[vec![1.0; n as usize], x.clone()], false);
        let square: f64 = x.iter().map(|x| x * x).sum();
        for c in [&line.by_noise, &line.covariance] {
            assert!((c[(0, 0)] * f64::from(n) - 1.0).abs() < 1e-9 && (c[(1, 1)] * square - 1.0).abs() < 1e-9, "{c}");
            assert!(c[(0, 1)].abs() < 1e-12);
        }
        let twice = [vec![1.0; n as usize], vec![1.0; n as usize]];
        let c = of(&twice, false).by_noise;
        assert!(((c[(0, 0)] + 2.0 * c[(0, 1)] + c[(1, 1)]) * f64::from(n) - 1.0).abs() < 1e-6, "{c}");
        assert!(of(&twice, false).covariance[(0, 0)].is_infinite());
        assert_eq!(of(&twice, true).by_noise.norm(), 0.0);
        assert!((line.taken - 2.0).abs() < 1e-9 && of(&twice, true).taken == 0.0);
    }

    /// In one group of records it dies away, in the other it does not: each keeps the noise that it has.
    #[test]
    fn noise_that_is_less_than_before_has_faded() {
        let (ones, before) = ([vec![1.0; 800]], [vec![white(400, 5)], vec![white(400, 7)]]);
        for (factors, expected) in [([0.3, 1.0], [true, false]), ([3.0, 0.3], [false, true]), ([1.0, 3.0], [false; 2])]
        {
            let scaled = |factor: f64, seed| white(400, seed).into_iter().map(move |v| factor * v);
            let residuals: Vec<f64> = scaled(factors[0], 6).chain(scaled(factors[1], 8)).collect();
            let (first, second) = (0..400, 400..800);
            let fit = Linearised {
                columns: &ones,
                residuals: &residuals,
                records: &[vec![first], vec![second]],
                common: &[],
                at_bound: &[false],
                in_time: None,
            };
            let decayed = fit.decayed(&before);
            assert_eq!(decayed, expected, "{factors:?}");
            let counts = fit.noise_that_counts(&before, &decayed);
            for group in 0..2 {
                let own = vec![residuals[400 * group..400 * (group + 1)].to_vec()];
                assert_eq!(counts[group], if decayed[group] { before[group].clone() } else { own });
            }
        }
    }

    /// A prior of standard deviation 0.1 on what 400 samples of noise 100 hardly see.
    #[test]
    fn a_prior_counts_as_one_measurement() {
        let mut column = vec![0.01; 400];
        column.push(1.0 / 0.1);
        let mut residuals = white(400, 2);
        residuals.push(0.0);
        let found = errors(&[column], &residuals, 400, &[], &[false]).of_variable(0);
        let exact = (1.0 / (400.0 * 1e-4 + 100.0f64)).sqrt();
        assert!((found / exact - 1.0).abs() < 1e-3, "{found} against {exact}");
    }

    #[test]
    fn what_is_at_a_bound_or_undetermined_says_so_and_spares_the_rest() {
        let x: Vec<f64> = (0..200).map(|i| (f64::from(i) * 0.3).sin()).collect();
        let columns = vec![vec![1.0; 200], vec![1.0; 200], vec![0.3; 200], x.clone(), vec![0.0; 200]];
        let found = errors(&columns, &white(200, 3), 200, &[], &[false, false, true, false, false]);
        assert!(found.of_variable(2).is_nan());
        assert!([0, 1, 4].iter().all(|&j| found.of_variable(j) == f64::INFINITY), "{found:?}");
        let square: f64 = x.iter().map(|v| v * v).sum();
        assert!((found.of_variable(3) * square.sqrt() - 1.0).abs() < 0.3, "{}", found.of_variable(3));
        assert!(found.inflation(0) == 1.0);
        let more = found.and(&[0.0, 0.0, 0.5, 0.5, 0.0]);
        assert!(more.of_variable(2).is_nan() && more.of_variable(3) > 0.5);
    }

    /// NIST StRD Misra1a's columns at its certified values: the certified standard errors, from the spread that NIST
    /// takes.
    #[test]
    fn believed_errors_are_those_of_nist() {
        let t = [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0];
        let (b1, b2, spread) = (238.942_129_18, 5.501_564_318_1e-4, 0.101_878_76);
        let decay = |t: f64| (-b2 * t).exp();
        let columns = vec![
            t.iter().map(|t| -(1.0 - decay(*t)) / spread).collect::<Vec<f64>>(),
            t.iter().map(|t| -b1 * t * decay(*t) / spread).collect(),
        ];
        let found = errors(&columns, &[0.0; 14], 14, &[], &[false, false]).believed;
        assert!((found[(0, 0)].sqrt() / 2.707_007_524_1 - 1.0).abs() < 1e-4, "{}", found[(0, 0)].sqrt());
        assert!((found[(1, 1)].sqrt() / 7.266_868_843_6e-6 - 1.0).abs() < 1e-4, "{}", found[(1, 1)].sqrt());
    }
}
