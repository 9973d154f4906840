//! Products of long columns: what every fit to many samples spends its time on beside the simulation.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Rows that are taken at a time, so that the parts of all columns stay in the processor's cache.
const BLOCK: usize = 2048;

/// `aᵀb` of columns of one length.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    // eight sums at once: a single one would wait for each addition
    let ((a8, a_rest), (b8, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut lanes = [0.0; 8];
    for (a, b) in a8.iter().zip(b8) {
        for k in 0..8 {
            lanes[k] += a[k] * b[k];
        }
    }
    lanes.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

/// `JᵀJ` of columns of one length.
pub fn gram<C: AsRef<[f64]> + Sync>(columns: &[C]) -> DMatrix<f64> {
    let n = columns.len();
    let rows = columns.first().map_or(0, |c| c.as_ref().len());
    let blocks: Vec<DMatrix<f64>> = (0..rows.div_ceil(BLOCK))
        .into_par_iter()
        .map(|b| {
            let range = b * BLOCK..rows.min((b + 1) * BLOCK);
            let part = |j: usize| &columns[j].as_ref()[range.clone()];
            let mut block = DMatrix::zeros(n, n);
            for i in 0..n {
                for j in 0..=i {
                    block[(i, j)] = dot(part(i), part(j));
                }
            }
            block
        })
        .collect();
    // in their order, so that the sum does not depend on the threads
    let mut sum = blocks.iter().fold(DMatrix::zeros(n, n), |sum, block| sum + block);
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
    sum.par_chunks_mut(BLOCK).enumerate().for_each(|(b, part)| {
        for (column, by) in columns.iter().zip(x).filter(|(_, by)| **by != 0.0) {
            part.iter_mut().zip(&column.as_ref()[b * BLOCK..]).for_each(|(s, c)| *s += by * c);
        }
    });
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_many_blocks_are_those_of_the_matrix() {
        let (rows, n) = (2 * BLOCK + 13, 3);
        let columns: Vec<Vec<f64>> =
            (0..n).map(|j| (0..rows).map(|i| ((i * (j + 2)) as f64 * 0.1).sin()).collect()).collect();
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
