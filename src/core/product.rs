//! Products of long columns: what every fit to many samples spends its time on beside the simulation.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::wide::widened;

/// Rows that are taken at a time, so that the parts of all columns stay in the processor's nearest cache.
const BLOCK: usize = 256;
/// Blocks that one thread takes at a time.
const TOGETHER: usize = 16;

/// Sums at once: a single one would wait for each addition.
const LANES: usize = 8;
type Lanes = [f64; LANES];

/// `aᵀb` of columns of one length.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a_lanes, a_rest), (b_lanes, b_rest)) = (a.as_chunks::<LANES>(), b.as_chunks::<LANES>());
    let mut sums = [0.0; LANES];
    add_products(a_lanes, b_lanes, &mut sums);
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

widened! {
    fn add_products(a: &[Lanes], b: &[Lanes], sums: &mut Lanes) {
        let mut all = *sums;
        for (a, b) in a.iter().zip(b) {
            for k in 0..LANES {
                all[k] += a[k] * b[k];
            }
        }
        *sums = all;
    }
}

/// The four products of two columns with two others: half the loads of computing them one by one.
pub fn four_dots([a, b]: [&[f64]; 2], [c, d]: [&[f64]; 2]) -> [f64; 4] {
    let n = a.len() - a.len() % LANES;
    let [la, lb, lc, ld] = [a, b, c, d].map(|of| of.as_chunks::<LANES>().0);
    let mut sums = [[0.0; LANES]; 4];
    add_four(la, lb, lc, ld, &mut sums);
    let rest = |x: &[f64], y: &[f64]| x[n..].iter().zip(&y[n..]).map(|(x, y)| x * y).sum::<f64>();
    let rests = [rest(a, c), rest(a, d), rest(b, c), rest(b, d)];
    std::array::from_fn(|i| sums[i].iter().sum::<f64>() + rests[i])
}

widened! {
    fn add_four(a: &[Lanes], b: &[Lanes], c: &[Lanes], d: &[Lanes], sums: &mut [Lanes; 4]) {
        let [mut ac, mut ad, mut bc, mut bd] = *sums;
        for (((a, b), c), d) in a.iter().zip(b).zip(c).zip(d) {
            for k in 0..LANES {
                ac[k] += a[k] * c[k];
                ad[k] += a[k] * d[k];
                bc[k] += b[k] * c[k];
                bd[k] += b[k] * d[k];
            }
        }
        *sums = [ac, ad, bc, bd];
    }
}

/// `JᵀJ` of columns of one length.
pub fn gram<C: AsRef<[f64]> + Sync>(columns: &[C]) -> DMatrix<f64> {
    let n = columns.len();
    let rows = columns.first().map_or(0, |c| c.as_ref().len());
    let parts: Vec<DMatrix<f64>> = (0..rows.div_ceil(TOGETHER * BLOCK))
        .into_par_iter()
        .map(|p| {
            let mut part = DMatrix::zeros(n, n);
            for first in (p * TOGETHER * BLOCK..rows.min((p + 1) * TOGETHER * BLOCK)).step_by(BLOCK) {
                let block = |j: usize| &columns[j].as_ref()[first..rows.min(first + BLOCK)];
                // What belongs to one run or sensor changes nothing elsewhere.
                let moved: Vec<usize> = (0..n).filter(|&j| block(j).iter().any(|c| *c != 0.0)).collect();
                let pairs: Vec<[usize; 2]> =
                    moved.chunks(2).map(|pair| [pair[0], *pair.last().unwrap_or(&pair[0])]).collect();
                for (k, &[i, below]) in pairs.iter().enumerate() {
                    for &[j, beside] in &pairs[..=k] {
                        let four = four_dots([block(i), block(below)], [block(j), block(beside)]);
                        // with an odd number of columns, the last is paired with itself
                        let places = [(i, j), (i, beside), (below, j), (below, beside)];
                        let own = [true, beside > j, below > i, below > i && beside > j];
                        for ((place, product), _) in places.into_iter().zip(four).zip(own).filter(|(_, own)| *own) {
                            part[place] += product;
                        }
                    }
                }
            }
            part
        })
        .collect();
    // in their order, so that the sum does not depend on the threads
    let mut sum = parts.iter().fold(DMatrix::zeros(n, n), |sum, part| sum + part);
    sum.fill_upper_triangle_with_lower_triangle();
    sum
}

/// `Jᵀv`.
pub fn along<C: AsRef<[f64]> + Sync>(columns: &[C], v: &[f64]) -> DVector<f64> {
    DVector::from_vec(columns.par_iter().map(|c| dot(c.as_ref(), v)).collect())
}

/// `v + Jx`.
pub fn plus<C: AsRef<[f64]> + Sync>(v: &[f64], columns: &[C], x: &[f64]) -> Vec<f64> {
    let mut sum = v.to_vec();
    sum.par_chunks_mut(TOGETHER * BLOCK).enumerate().for_each(|(p, part)| {
        for (column, by) in columns.iter().zip(x).filter(|(_, by)| **by != 0.0) {
            part.iter_mut().zip(&column.as_ref()[p * TOGETHER * BLOCK..]).for_each(|(s, c)| *s += by * c);
        }
    });
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_many_blocks_are_those_of_the_matrix() {
        let (rows, n) = (2 * TOGETHER * BLOCK + 13, 3);
        // one of them moves only the last rows
        let value = |i: usize, j: usize| if j == 1 && i < 300 { 0.0 } else { ((i * (j + 2)) as f64 * 0.1).sin() };
        let columns: Vec<Vec<f64>> = (0..n).map(|j| (0..rows).map(|i| value(i, j)).collect()).collect();
        let v: Vec<f64> = (0..rows).map(|i| (i as f64 * 0.03).cos()).collect();
        let j = DMatrix::from_fn(rows, n, |i, k| columns[k][i]);
        let as_vector = DVector::from_column_slice(&v);
        assert!((gram(&columns) - j.transpose() * &j).norm() < 1e-9);
        assert!((along(&columns, &v) - j.transpose() * &as_vector).norm() < 1e-9);
        let moved = plus(&v, &columns, &[2.0, 0.0, -1.0]);
        let expected = as_vector + j * DVector::from_row_slice(&[2.0, 0.0, -1.0]);
        assert!((DVector::from_vec(moved) - expected).norm() < 1e-9);
    }
}
