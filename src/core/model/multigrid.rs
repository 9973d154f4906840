//! Symmetric positive definite systems of a graph of any size: `(D - W) x = b`, with a weight `W` an edge that the
//! diagonal at least balances.
//!
//! Small ones are solved by factors ([`Symmetric`]), of which the cost rises faster than the number of nodes. Large
//! ones are solved by conjugate gradients with an algebraic multigrid of aggregates: each node is paired with the
//! neighbour of the greatest weight, and pairs with pairs, until few are left (Notay 2010, Electron. Trans. Numer.
//! Anal. 37:123-146). The cost of a step is linear in the nodes.

use crate::model::sparse::{Factors, Symmetric};

/// Up to so many nodes are solved by factors.
const DIRECT: usize = 12_000;
/// Residual as a share of the right side, at which the iteration ends. Newton's method corrects what is left.
const RESIDUAL: f64 = 1e-5;
const MOST_STEPS: usize = 300;

/// The pattern of a system; the numbers may change.
pub(crate) struct Multigrid {
    edges: Vec<(usize, usize)>,
    direct: Option<Symmetric>,
}

impl Multigrid {
    /// Of nodes with edges between them; edges between the same two add up.
    pub(crate) fn new(nodes: usize, edges: Vec<(usize, usize)>) -> Multigrid {
        let direct = (nodes <= DIRECT).then(|| Symmetric::new(nodes, &edges));
        Multigrid { edges, direct }
    }

    /// Solves for `x` in place of `b`: `diagonal` by node, `weights` by edge, what stands off the diagonal with its
    /// sign turned.
    pub(crate) fn solve(&self, diagonal: &[f64], weights: &[f64], b: &mut [f64]) {
        if let Some(direct) = &self.direct {
            let off: Vec<f64> = weights.iter().map(|w| -w).collect();
            return direct.factors(diagonal, &off).solve(b);
        }
        let edges = self.edges.iter().zip(weights).map(|(&(i, j), &w)| (i, j, w));
        let (levels, of) = coarser(Matrix::new(diagonal.to_vec(), edges));
        let last = &levels[levels.len() - 1];
        let (edges, off): (Vec<_>, Vec<_>) = last.edges().map(|(i, j, w)| ((i, j), -w)).unzip();
        let pattern = Symmetric::new(last.diagonal.len(), &edges);
        let cycle = Cycle { last: pattern.factors(&last.diagonal, &off), levels, of };
        b.copy_from_slice(&conjugate_gradients(&cycle, b));
    }
}

fn conjugate_gradients(cycle: &Cycle<'_>, b: &[f64]) -> Vec<f64> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let add = |a: &mut [f64], by: f64, b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += by * b);
    let enough = RESIDUAL * dot(b, b).sqrt();
    let (mut x, mut r) = (vec![0.0; b.len()], b.to_vec());
    let mut z = cycle.run(0, &r);
    let (mut p, mut rz) = (z.clone(), dot(&r, &z));
    let mut ap = vec![0.0; b.len()];
    for _ in 0..MOST_STEPS {
        if dot(&r, &r).sqrt() <= enough {
            break;
        }
        cycle.levels[0].times(&p, &mut ap);
        let by = rz / dot(&p, &ap);
        add(&mut x, by, &p);
        add(&mut r, -by, &ap);
        z = cycle.run(0, &r);
        let next = dot(&r, &z);
        let kept = next / rz;
        p.iter_mut().zip(&z).for_each(|(p, z)| *p = z + kept * *p);
        rz = next;
    }
    x
}

/// `D - W`, row by row.
struct Matrix {
    diagonal: Vec<f64>,
    /// Where the weights of each row begin.
    rows: Vec<usize>,
    /// The other node and the weight.
    near: Vec<(usize, f64)>,
}

impl Matrix {
    fn new(diagonal: Vec<f64>, edges: impl Iterator<Item = (usize, usize, f64)> + Clone) -> Matrix {
        let mut rows = vec![0; diagonal.len() + 1];
        edges.clone().for_each(|(i, j, _)| {
            rows[i + 1] += 1;
            rows[j + 1] += 1;
        });
        (0..diagonal.len()).for_each(|i| rows[i + 1] += rows[i]);
        let mut next = rows.clone();
        let mut near = vec![(0, 0.0); rows[diagonal.len()]];
        for (i, j, w) in edges {
            for (i, j) in [(i, j), (j, i)] {
                near[next[i]] = (j, w);
                next[i] += 1;
            }
        }
        Matrix { diagonal, rows, near }
    }

    fn row(&self, i: usize) -> &[(usize, f64)] {
        &self.near[self.rows[i]..self.rows[i + 1]]
    }

    /// Edges and their weights.
    fn edges(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        (0..self.diagonal.len())
            .flat_map(|i| self.row(i).iter().filter(move |(j, _)| *j > i).map(move |&(j, w)| (i, j, w)))
    }

    /// `W x` at a node.
    fn around(&self, i: usize, x: &[f64]) -> f64 {
        self.row(i).iter().map(|&(j, w)| w * x[j]).sum()
    }

    fn times(&self, x: &[f64], y: &mut [f64]) {
        y.iter_mut().enumerate().for_each(|(i, y)| *y = self.diagonal[i] * x[i] - self.around(i, x));
    }

    /// The aggregate of each node, of pairs along the greatest weights, and their number.
    fn pairs(&self) -> (Vec<usize>, usize) {
        let (mut of, mut count) = (vec![usize::MAX; self.diagonal.len()], 0);
        for i in 0..of.len() {
            if of[i] != usize::MAX {
                continue;
            }
            of[i] = count;
            let free = self.row(i).iter().filter(|(j, _)| of[*j] == usize::MAX);
            if let Some(&(j, _)) = free.max_by(|a, b| a.1.total_cmp(&b.1)) {
                of[j] = count;
            }
            count += 1;
        }
        (of, count)
    }

    /// The system of aggregates, in which all nodes of one have the same value.
    fn aggregated(&self, of: &[usize], count: usize) -> Matrix {
        let mut diagonal = vec![0.0; count];
        of.iter().zip(&self.diagonal).for_each(|(&a, d)| diagonal[a] += d);
        // Nodes by aggregate.
        let mut begin = vec![0; count + 1];
        of.iter().for_each(|&a| begin[a + 1] += 1);
        (0..count).for_each(|a| begin[a + 1] += begin[a]);
        let (mut next, mut nodes) = (begin.clone(), vec![0; of.len()]);
        for (i, &a) in of.iter().enumerate() {
            nodes[next[a]] = i;
            next[a] += 1;
        }
        let (mut rows, mut near) = (vec![0; count + 1], Vec::new());
        let mut seen = vec![usize::MAX; count];
        for a in 0..count {
            let first = near.len();
            for &i in &nodes[begin[a]..begin[a + 1]] {
                for &(j, w) in self.row(i) {
                    let other = of[j];
                    if other == a {
                        diagonal[a] -= w;
                    } else if seen[other] != usize::MAX && seen[other] >= first {
                        let known: &mut (usize, f64) = &mut near[seen[other]];
                        known.1 += w;
                    } else {
                        seen[other] = near.len();
                        near.push((other, w));
                    }
                }
            }
            rows[a + 1] = near.len();
        }
        Matrix { diagonal, rows, near }
    }
}

/// Systems of fewer and fewer aggregates, and the factors of the last.
struct Cycle<'a> {
    levels: Vec<Matrix>,
    /// The aggregate of the next level of each node.
    of: Vec<Vec<usize>>,
    last: Factors<'a>,
}

/// Systems of pairs of pairs, down to one that is small, or does not get smaller; and the aggregate of each node but
/// the last one's. What a level costs, two visits included, is half of the one before.
fn coarser(finest: Matrix) -> (Vec<Matrix>, Vec<Vec<usize>>) {
    let (mut levels, mut of): (Vec<Matrix>, Vec<Vec<usize>>) = (Vec::new(), Vec::new());
    let mut level = finest;
    while level.diagonal.len() > DIRECT {
        let (first, count) = level.pairs();
        let half = level.aggregated(&first, count);
        let (second, count) = half.pairs();
        if count > level.diagonal.len() * 3 / 4 {
            break;
        }
        of.push(first.into_iter().map(|a| second[a]).collect());
        levels.push(std::mem::replace(&mut level, half.aggregated(&second, count)));
    }
    levels.push(level);
    (levels, of)
}

impl Cycle<'_> {
    /// An approximate solution at a level, linear and symmetric in the right side: a sweep forwards, the aggregates
    /// twice, a sweep back.
    fn run(&self, level: usize, b: &[f64]) -> Vec<f64> {
        let matrix = &self.levels[level];
        let Some(of) = self.of.get(level) else {
            let mut x = b.to_vec();
            self.last.solve(&mut x);
            return x;
        };
        let mut x = vec![0.0; b.len()];
        (0..b.len()).for_each(|i| x[i] = (b[i] + matrix.around(i, &x)) / matrix.diagonal[i]);
        let coarse = &self.levels[level + 1];
        let mut known = vec![0.0; coarse.diagonal.len()];
        for (i, &a) in of.iter().enumerate() {
            known[a] += b[i] - matrix.diagonal[i] * x[i] + matrix.around(i, &x);
        }
        let mut by = self.run(level + 1, &known);
        if level + 1 < self.of.len() {
            let mut taken = vec![0.0; known.len()];
            coarse.times(&by, &mut taken);
            known.iter_mut().zip(&taken).for_each(|(known, taken)| *known -= taken);
            by.iter_mut().zip(self.run(level + 1, &known)).for_each(|(by, more)| *by += more);
        }
        x.iter_mut().zip(of).for_each(|(x, &a)| *x += by[a]);
        (0..b.len()).rev().for_each(|i| x[i] = (b[i] + matrix.around(i, &x)) / matrix.diagonal[i]);
        x
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of 150 x 100 with weights over six decades, held at one corner alone, and a few edges twice.
    #[test]
    fn a_large_grid_is_solved_as_exactly_as_asked() {
        let (w, h) = (150, 100);
        let mut edges = Vec::new();
        for i in 0..w * h {
            edges.extend((i % w + 1 < w).then_some((i, i + 1)));
            edges.extend((i / w + 1 < h).then_some((i + w, i)));
        }
        edges.extend([edges[5], edges[77]]);
        let weights: Vec<f64> = (0..edges.len()).map(|k| 10f64.powf(((k * 7919) % 61) as f64 / 10.0)).collect();
        let mut diagonal = vec![0.0; w * h];
        diagonal[0] = 3.0;
        let exact: Vec<f64> = (0..w * h).map(|i| ((i * 13) % 29) as f64 - 9.0).collect();
        let mut b = vec![0.0; w * h];
        b[0] = 3.0 * exact[0];
        for (&(i, j), g) in edges.iter().zip(&weights) {
            diagonal[i] += g;
            diagonal[j] += g;
            b[i] += g * (exact[i] - exact[j]);
            b[j] += g * (exact[j] - exact[i]);
        }
        let system = Multigrid::new(w * h, edges);
        assert!(system.direct.is_none());
        let mut x = b.clone();
        system.solve(&diagonal, &weights, &mut x);
        // What is left, solved for again, is that much smaller: the values come out after some rounds.
        for _ in 0..6 {
            let mut left = b.clone();
            for (&(i, j), g) in system.edges.iter().zip(&weights) {
                left[i] -= g * (x[i] - x[j]);
                left[j] -= g * (x[j] - x[i]);
            }
            left[0] -= 3.0 * x[0];
            system.solve(&diagonal, &weights, &mut left);
            x.iter_mut().zip(left).for_each(|(x, by)| *x += by);
        }
        let worst = x.iter().zip(&exact).map(|(x, e)| (x - e).abs()).fold(0.0, f64::max);
        assert!(worst < 1e-6, "{worst}");
    }
}
