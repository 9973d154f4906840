//! The forcing at a place as a linear inverse problem, and the evidence for the place.
//!
//! What the fitted model leaves is `y = J δ + A f + e`: its free variables may move by `δ`, which is known as well as
//! it was before the fit, and the forcing `f` is a random process that forgets in a time `τ`, with jumps (Ornstein &
//! Uhlenbeck 1930) or without (Matérn 1960). Neighbouring errors `e` are alike ([`Errors`]). Integrated over `δ` and
//! `f`, the likelihood of a place has a closed form (MacKay 1992, Neural Computation 4, 415; Tarantola 2005, Inverse
//! Problem Theory, ch. 3); its greatest value over strength and `τ` is the place's evidence. This strength is also that
//! of the discrepancy principle (Morozov 1966), wherever the place explains the record: what is left is as large as the
//! errors.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::rest::cells::{Row, Times};
use crate::diagnose::rest::response::Response;
use crate::fit::numeric::uncertainty::correlation_inflation;
use crate::golden::least_looked_at;
use crate::product::{along, dot, four_dots, gram};

/// How a forcing may go on from knot to knot: those that are tried, and tones beside them.
pub(crate) const PROCESSES: [Process; 8] = [
    Process { turn: None, memory: 2.0 },
    Process { turn: None, memory: 12.0 },
    Process { turn: None, memory: 72.0 },
    Process { turn: None, memory: 432.0 },
    Process { turn: Some(0.0), memory: 1.0 },
    Process { turn: Some(0.0), memory: 4.0 },
    Process { turn: Some(0.0), memory: 16.0 },
    Process { turn: Some(0.0), memory: 64.0 },
];

/// A random process.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Process {
    /// Where its slope is continuous, too, the angle by which it turns from knot to knot: an oscillator that noise
    /// drives. Otherwise it may jump.
    pub(crate) turn: Option<f64>,
    /// In how many knots it forgets.
    pub(crate) memory: f64,
}

impl Process {
    /// A tone of so many knots a cycle, steady and less so.
    pub(crate) fn tones(knots: f64) -> [Process; 2] {
        [30.0, 300.0].map(|memory| Process { turn: Some(std::f64::consts::TAU / knots), memory })
    }

    /// Coefficients of the regression of a value on the two before it, and the variance of what is new in it, of a
    /// process of variance 1 (Box & Jenkins 1970, Time Series Analysis, 3.2).
    fn regression(self) -> ([f64; 2], f64) {
        let kept = (-1.0 / self.memory).exp();
        let Some(turn) = self.turn else { return ([kept, 0.0], 1.0 - kept * kept) };
        let [one, two] = [2.0 * kept * turn.cos(), -kept * kept];
        ([one, two], (1.0 + two) * ((1.0 - two).powi(2) - one * one) / (1.0 - two))
    }

    /// Adds its precision, times `by`, to a lower triangle from row `first` on; returns the logarithm of the
    /// precision's determinant.
    fn add(self, by: f64, m: &mut [Vec<f64>], first: usize, knots: usize) -> f64 {
        let ([one, two], new) = self.regression();
        let correlation = one / (1.0 - two);
        let mut log_determinant = 0.0;
        for k in 0..knots {
            // What is new in it, and its variance: of the first two values, as they are without what came before.
            let (from, variance) = match k {
                0 => ([0.0, 0.0], 1.0),
                1 => ([correlation, 0.0], 1.0 - correlation * correlation),
                _ => ([one, two], new),
            };
            let weights = [1.0, -from[0], -from[1]];
            for (a, wa) in weights.iter().enumerate().filter(|(a, _)| *a <= k) {
                for (b, wb) in weights.iter().enumerate().filter(|(b, _)| *b >= a && *b <= k) {
                    m[first + k - a][first + k - b] += by * wa * wb / variance;
                }
            }
            log_determinant += (by / variance).ln();
        }
        log_determinant
    }
}

/// How the errors of rows are, beyond what is believed of each: those of neighbours are alike, so that together they
/// count less (Box & Jenkins 1970, 3.2: a regression of each on the one before it).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Errors {
    /// Their square over what it was believed to be; not below 1.
    pub(crate) excess: f64,
    /// Correlation of neighbours.
    pub(crate) alike: f64,
}

impl Errors {
    /// As they are believed to be.
    pub(crate) const BELIEVED: Errors = Errors { excess: 1.0, alike: 0.0 };

    /// As they are where this is left, in units of what they are believed to be.
    pub(crate) fn of(left: &[f64]) -> Errors {
        let inflation = correlation_inflation(left);
        Errors {
            excess: (dot(left, left) / left.len().max(1) as f64).max(1.0),
            alike: (inflation - 1.0) / (inflation + 1.0),
        }
    }

    /// Turns a column in units of believed errors into one whose errors are independent and of variance 1.
    pub(crate) fn whiten(self, rows: &[Row], column: &mut [f64]) {
        let new = (self.excess * (1.0 - self.alike * self.alike)).sqrt();
        for i in (0..column.len()).rev() {
            let follows = i > 0 && rows[i - 1].cell.is_some() && rows[i - 1].cell.map(|c| c + 1) == rows[i].cell;
            column[i] =
                if follows { (column[i] - self.alike * column[i - 1]) / new } else { column[i] / self.excess.sqrt() };
        }
    }
}

/// The data of a run, whitened: errors are independent and of variance 1.
pub(crate) struct Data {
    pub(crate) rows: Vec<Row>,
    pub(crate) errors: Errors,
    /// What the model leaves when its variables stand where they were known to be, less what the supposed forcing does
    /// beyond its linear answer.
    pub(crate) y: Vec<f64>,
    /// How the model moves with one standard deviation of what was known of each variable, and then of its own errors.
    pub(crate) slopes: Vec<Vec<f64>>,
}

impl Data {
    /// The same where its errors, believed so far, are others.
    pub(crate) fn under(&self, errors: Errors) -> Data {
        let (mut y, mut slopes) = (self.y.clone(), self.slopes.clone());
        slopes.iter_mut().chain([&mut y]).for_each(|column| errors.whiten(&self.rows, column));
        Data { rows: self.rows.clone(), errors, y, slopes }
    }

    /// What a forcing with these columns and moves of the variables leave of each row.
    pub(crate) fn rest(&self, columns: &[Vec<f64>], (forcing, moves): &(Vec<Vec<f64>>, Vec<f64>)) -> Vec<f64> {
        let mut rest = self.y.clone();
        let with_slopes = columns.iter().chain(&self.slopes);
        for (x, column) in forcing.iter().flatten().chain(moves).zip(with_slopes) {
            rest.iter_mut().zip(column).for_each(|(r, c)| *r -= x * c);
        }
        rest
    }
}

/// The normal equations of a place.
pub(crate) struct Normal {
    /// `AᵀA`, then with the slopes.
    matrix: DMatrix<f64>,
    right: DVector<f64>,
    square: f64,
    rows: usize,
    /// Knots of one component, and components.
    knots: usize,
    components: usize,
    slopes: usize,
}

/// How a forcing is believed to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Belief {
    /// How it goes on.
    pub(crate) process: Process,
    /// Natural logarithm of the mean square of what it does to a row, in units of the row's error.
    pub(crate) log_power: f64,
}

/// What a belief comes to.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    pub(crate) belief: Belief,
    /// Natural logarithm of the likelihood, but for what all places share.
    pub(crate) evidence: f64,
    /// What is left in a row, in units of its error, mean square.
    pub(crate) left: f64,
}

/// A forcing.
pub(crate) struct Solution {
    /// Values at the knots of each component.
    pub(crate) forcing: Vec<Vec<f64>>,
    /// Their standard deviations.
    pub(crate) sd: Vec<Vec<f64>>,
}

/// The columns of a forcing: what a unit pulse at each knot does to each row, whitened as the data.
pub(crate) fn columns(data: &Data, response: &Response, times: &Times) -> Vec<Vec<f64>> {
    let mut all = Vec::new();
    for component in response {
        for knot in 0..times.knots {
            let value = |row: &Row| {
                let since = row.cell.and_then(|cell| times.since(cell, knot));
                since.and_then(|i| component[row.sensor].get(i)).map_or(0.0, |a| a / row.sd_m)
            };
            let mut column: Vec<f64> = data.rows.iter().map(value).collect();
            data.errors.whiten(&data.rows, &mut column);
            all.push(column);
        }
    }
    all
}

impl Normal {
    /// Of a place with these columns; of no forcing at all where there are none.
    pub(crate) fn of(data: &Data, columns: Vec<Vec<f64>>, components: usize) -> Normal {
        let knots = columns.len() / components.max(1);
        let mut all = columns;
        all.extend(data.slopes.iter().cloned());
        Normal {
            matrix: gram(&all),
            right: along(&all, &data.y),
            square: dot(&data.y, &data.y),
            rows: data.y.len(),
            knots,
            components,
            slopes: data.slopes.len(),
        }
    }

    fn size(&self) -> usize {
        self.knots * self.components + self.slopes
    }

    /// Variance of the forcing at a knot that gives it a power.
    fn variance(&self, log_power: f64) -> f64 {
        let forced = self.knots * self.components;
        let trace: f64 = (0..forced).map(|i| self.matrix[(i, i)]).sum();
        log_power.exp() * self.rows as f64 / trace.max(f64::MIN_POSITIVE)
    }

    /// The matrix of the posterior, factored, and the logarithm of the determinant of its ratio to the prior.
    fn factored(&self, belief: Belief) -> Option<(Cholesky, f64)> {
        let n = self.size();
        let mut m: Vec<Vec<f64>> = (0..n).map(|i| (0..=i).map(|j| self.matrix[(i, j)]).collect()).collect();
        let by = 1.0 / self.variance(belief.log_power);
        let forced = self.knots * self.components;
        let of = |c: usize| belief.process.add(by, &mut m, c * self.knots, self.knots);
        let prior: f64 = (0..self.components).map(of).sum();
        m.iter_mut().enumerate().skip(forced).for_each(|(i, row)| row[i] += 1.0);
        let factor = Cholesky::of(m)?;
        let log_ratio = factor.log_determinant() - prior;
        Some((factor, log_ratio))
    }

    /// The evidence for a belief; none where the matrix is singular.
    pub(crate) fn judged(&self, belief: Belief) -> Option<Found> {
        let (factor, log_ratio) = self.factored(belief)?;
        let half = factor.forward(self.right.as_slice());
        let left = (self.square - dot(&half, &half)).max(0.0);
        Some(Found { belief, evidence: -0.5 * (left + log_ratio), left: left / self.rows as f64 })
    }

    /// The best power for a process, and the evidence for it.
    pub(crate) fn best(&self, process: Process, steps: usize) -> Option<Found> {
        if self.knots == 0 {
            return self.judged(Belief { process, log_power: 0.0 });
        }
        let mean = (self.square / self.rows as f64).max(1.0).ln();
        let at = |log_power: f64| {
            let found = self.judged(Belief { process, log_power });
            (found.as_ref().map_or(f64::INFINITY, |found| -found.evidence), found)
        };
        least_looked_at(at, -4.0, mean + 4.0, steps)
    }

    /// The forcing at the knots of each component, and the moves of the variables, in units of what was known of each.
    pub(crate) fn mean(&self, found: &Found) -> Option<(Vec<Vec<f64>>, Vec<f64>)> {
        let (factor, _) = self.factored(found.belief)?;
        Some(self.parted(factor.solve(self.right.as_slice())))
    }

    /// Values of all unknowns: those at the knots of each component, and those of the variables.
    fn parted(&self, mut values: Vec<f64>) -> (Vec<Vec<f64>>, Vec<f64>) {
        let moves = values.split_off(self.knots * self.components);
        (values.chunks(self.knots.max(1)).map(<[f64]>::to_vec).collect(), moves)
    }

    /// The forcing of a belief.
    pub(crate) fn solved(&self, found: &Found) -> Option<Solution> {
        let (factor, _) = self.factored(found.belief)?;
        let sd = factor.inverse_diagonal().iter().map(|v| v.sqrt()).collect();
        Some(Solution { forcing: self.parted(factor.solve(self.right.as_slice())).0, sd: self.parted(sd).0 })
    }
}

/// The root of a pivot; none where the matrix is not positive.
fn root(pivot: f64) -> Option<f64> {
    (pivot > 0.0).then(|| pivot.sqrt())
}

/// The lower triangle of a factored matrix, row by row: its products are those of contiguous rows.
struct Cholesky(Vec<Vec<f64>>);

impl Cholesky {
    /// Two rows at a time, from their products with two others.
    fn of(mut m: Vec<Vec<f64>>) -> Option<Cholesky> {
        let n = m.len();
        if !n.is_multiple_of(2) {
            m.push([vec![0.0; n], vec![1.0]].concat());
        }
        for i in (0..m.len()).step_by(2) {
            let (done, rest) = m.split_at_mut(i);
            let (one, two) = rest.split_at_mut(1);
            let (one, two) = (&mut one[0], &mut two[0]);
            for j in (0..i).step_by(2) {
                let (first, second) = (&done[j], &done[j + 1]);
                let of = four_dots([&one[..j], &two[..j]], [&first[..j], &second[..j]]);
                for (row, [by_first, by_second]) in [(&mut *one, [of[0], of[1]]), (&mut *two, [of[2], of[3]])] {
                    row[j] = (row[j] - by_first) / first[j];
                    row[j + 1] = (row[j + 1] - by_second - row[j] * second[j]) / second[j + 1];
                }
            }
            one[i] = root(one[i] - dot(&one[..i], &one[..i]))?;
            two[i] = (two[i] - dot(&two[..i], &one[..i])) / one[i];
            two[i + 1] = root(two[i + 1] - dot(&two[..=i], &two[..=i]))?;
        }
        m.truncate(n);
        Some(Cholesky(m))
    }

    fn log_determinant(&self) -> f64 {
        2.0 * self.0.iter().enumerate().map(|(i, row)| row[i].ln()).sum::<f64>()
    }

    fn forward(&self, right: &[f64]) -> Vec<f64> {
        let mut x = right.to_vec();
        for (i, row) in self.0.iter().enumerate() {
            x[i] = (x[i] - dot(&row[..i], &x[..i])) / row[i];
        }
        x
    }

    fn solve(&self, right: &[f64]) -> Vec<f64> {
        let mut x = self.forward(right);
        for i in (0..x.len()).rev() {
            x[i] /= self.0[i][i];
            let by = x[i];
            x[..i].iter_mut().zip(&self.0[i]).for_each(|(x, l)| *x -= l * by);
        }
        x
    }

    /// The diagonal of the matrix' inverse: the squares of the columns of the triangle's.
    fn inverse_diagonal(&self) -> Vec<f64> {
        let n = self.0.len();
        let mut sums = vec![0.0; n];
        for column in 0..n {
            let mut x = vec![0.0; n];
            x[column] = 1.0 / self.0[column][column];
            for i in column + 1..n {
                x[i] = -dot(&self.0[i][column..i], &x[column..i]) / self.0[i][i];
            }
            sums[column] = dot(&x, &x);
        }
        sums
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The precision of a process of variance 1 is the inverse of its covariance, which is known in closed form:
    /// `ρ^|k|` with jumps, and of an oscillator by the recursion of Yule and Walker.
    #[test]
    fn a_precision_is_the_inverse_of_its_covariance() {
        for process in PROCESSES.into_iter().chain(Process::tones(7.3)) {
            let n = 9;
            let ([one, two], _) = process.regression();
            let mut covariance = vec![1.0, one / (1.0 - two)];
            (2..n).for_each(|k| covariance.push(one * covariance[k - 1] + two * covariance[k - 2]));
            let c = DMatrix::from_fn(n, n, |i, j| covariance[i.abs_diff(j)]);
            let mut m: Vec<Vec<f64>> = (0..n).map(|i| vec![0.0; i + 1]).collect();
            let log_determinant = process.add(1.0, &mut m, 0, n);
            let p = DMatrix::from_fn(n, n, |i, j| m[i.max(j)][i.min(j)]);
            let off = (&p * &c - DMatrix::identity(n, n)).abs().max();
            assert!(off < 1e-5, "{process:?}: {off}");
            assert!(
                (log_determinant + c.determinant().ln()).abs() < 1e-4 * (1.0 + log_determinant.abs()),
                "{process:?}"
            );
        }
    }

    /// Against the matrix itself: the evidence is the logarithm of a normal density of the data.
    #[test]
    fn the_evidence_is_the_density_of_the_data() {
        let (rows, knots) = (12, 5);
        let mut random = fastrand::Rng::with_seed(3);
        let mut column = || (0..rows).map(|_| 4.0 * (random.f64() - 0.5)).collect::<Vec<f64>>();
        let columns: Vec<Vec<f64>> = (0..knots).map(|_| column()).collect();
        let (y, slopes) = (column(), vec![column()]);
        let data = Data { rows: Vec::new(), errors: Errors::BELIEVED, y, slopes };
        let normal = Normal::of(&data, columns.clone(), 1);
        let belief = Belief { process: PROCESSES[1], log_power: 0.5 };
        let found = normal.judged(belief).unwrap();
        let kept = (-1.0f64 / 12.0).exp();
        let variance = normal.variance(0.5);
        let prior = DMatrix::from_fn(knots, knots, |i, j| variance * kept.powi(i.abs_diff(j) as i32));
        let a = DMatrix::from_fn(rows, knots, |i, j| columns[j][i]);
        let j = DMatrix::from_fn(rows, 1, |i, _| data.slopes[0][i]);
        let c = DMatrix::identity(rows, rows) + &a * prior * a.transpose() + &j * j.transpose();
        let y = DVector::from_column_slice(&data.y);
        let square = y.dot(&(c.clone().try_inverse().unwrap() * &y));
        let exact = -0.5 * (square + c.determinant().ln());
        assert!((found.evidence - exact).abs() < 1e-8, "{} {exact}", found.evidence);
    }

    /// Whitened products are those with the inverse of the errors' covariance, `excess alike^|i-k|` between cells that
    /// follow each other.
    #[test]
    fn whitened_errors_are_independent() {
        let errors = Errors { excess: 3.0, alike: 0.7 };
        let cells = [None, Some(0), Some(1), Some(2), Some(5), Some(6)];
        let rows = cells.map(|cell| Row { sensor: 0, cell, sd_m: 1.0 });
        let related =
            |i: usize, k: usize| i == k || [1..4, 4..6].iter().any(|part| part.contains(&i) && part.contains(&k));
        let covariance =
            DMatrix::from_fn(6, 6, |i, k| if related(i, k) { 3.0 * 0.7f64.powi(i.abs_diff(k) as i32) } else { 0.0 });
        let column = [0.3, -1.0, 2.0, 0.5, 1.5, -0.2];
        let mut white = column;
        errors.whiten(&rows, &mut white);
        let exact = DVector::from_column_slice(&column);
        let exact = exact.dot(&(covariance.try_inverse().unwrap() * &exact));
        assert!((dot(&white, &white) - exact).abs() < 1e-12, "{white:?}");
        let mut random = fastrand::Rng::with_seed(4);
        let mut last = 0.0;
        let left: Vec<f64> = (0..20_000)
            .map(|_| {
                last = 0.7 * last + (3.0 * 0.51f64).sqrt() * 12f64.sqrt() * (random.f64() - 0.5);
                last
            })
            .collect();
        let found = Errors::of(&left);
        assert!((found.excess - 3.0).abs() < 0.15 && (found.alike - 0.7).abs() < 0.02, "{found:?}");
    }

    #[test]
    fn the_diagonal_of_an_inverse_and_a_solution_are_those_of_the_matrix() {
        let m = [[4.0, 1.0, 0.5], [1.0, 3.0, -0.7], [0.5, -0.7, 2.0]];
        let factor = Cholesky::of((0..3).map(|i| m[i][..=i].to_vec()).collect()).unwrap();
        let inverse = DMatrix::from_fn(3, 3, |i, j| m[i][j]).try_inverse().unwrap();
        let x = factor.solve(&[1.0, -2.0, 0.3]);
        for (i, d) in factor.inverse_diagonal().iter().enumerate() {
            assert!((d - inverse[(i, i)]).abs() < 1e-12);
            let own: f64 = (0..3).map(|j| m[i][j] * x[j]).sum();
            assert!((own - [1.0, -2.0, 0.3][i]).abs() < 1e-12);
        }
        assert!(Cholesky::of(vec![vec![1.0], vec![2.0, 1.0]]).is_none());
    }
}
