//! The step of the interior nodes: loops over slices, nothing else.
//!
//! Each node keeps the two waves that leave it, `fwd` downstream and `bwd` upstream. With the waves `Cp`, `Cm` that arrive,
//! `S = (Cp + Cm)/2`, `D = (Cp - Cm)/2`, the two characteristic equations, each averaged over both ends of its
//! characteristic, separate at a node of a uniform pipe into
//!
//! ```text
//! head   H (1 + κ) = S + b              κ, b: storage in the wall and the like, implicit and known part
//! flow   u (1 + μ) + ½R(u/B) = D + d    u = B Q; μ, d: the same for momentum (unsteady friction)
//! waves  fwd = (2H - S) + (2u - D),  bwd = (2H - S) - (2u - D)
//! ```
//!
//! The trapezoidal rule is hidden in `2X - incoming`: what a term takes from the arriving waves at the new time it takes
//! once more from the leaving ones.

use super::friction::NodeFriction;

/// Elastic interior with steady friction: nodes `1..n-1` of a segment, from the old leaving waves to the new.
#[inline]
pub fn elastic<F: NodeFriction>(fwd: &[f64], bwd: &[f64], new_fwd: &mut [f64], new_bwd: &mut [f64], friction: &F) {
    let Some(m) = fwd.len().checked_sub(2) else { return };
    let (cp, cm) = (&fwd[..m], &bwd[2..][..m]);
    let (new_fwd, new_bwd) = (&mut new_fwd[1..][..m], &mut new_bwd[1..][..m]);
    for i in 0..m {
        let (s, d) = (0.5 * (cp[i] + cm[i]), 0.5 * (cp[i] - cm[i]));
        let odd = 2.0 * friction.solve(d) - d;
        new_fwd[i] = s + odd;
        new_bwd[i] = s - odd;
    }
}

/// What the line terms of a segment amount to in one step.
pub struct Terms<'a> {
    /// Known storage part `b` at each node, m.
    pub storage: &'a [f64],
    /// Implicit storage `κ`.
    pub kappa: f64,
    /// Known momentum part `d` at each node, m.
    pub momentum: &'a [f64],
    /// Implicit momentum `μ`.
    pub mu: f64,
}

/// Interior with line terms; also gives head and `u = B Q` at nodes `1..n-1`. `friction` is that of the reach divided
/// by `1 + μ`.
#[inline]
#[allow(clippy::too_many_arguments)] // six slices of one segment, all of one length
pub fn with_terms<F: NodeFriction>(
    fwd: &[f64],
    bwd: &[f64],
    new_fwd: &mut [f64],
    new_bwd: &mut [f64],
    head: &mut [f64],
    u: &mut [f64],
    terms: &Terms,
    friction: &F,
) {
    let Some(m) = fwd.len().checked_sub(2) else { return };
    let (cp, cm) = (&fwd[..m], &bwd[2..][..m]);
    let (new_fwd, new_bwd) = (&mut new_fwd[1..][..m], &mut new_bwd[1..][..m]);
    let (head, u) = (&mut head[1..][..m], &mut u[1..][..m]);
    let (storage, momentum) = (&terms.storage[1..][..m], &terms.momentum[1..][..m]);
    let (by_kappa, by_mu) = (1.0 / (1.0 + terms.kappa), 1.0 / (1.0 + terms.mu));
    for i in 0..m {
        let (s, d) = (0.5 * (cp[i] + cm[i]), 0.5 * (cp[i] - cm[i]));
        let h = (s + storage[i]) * by_kappa;
        let v = friction.solve((d + momentum[i]) * by_mu);
        head[i] = h;
        u[i] = v;
        let (even, odd) = (2.0 * h - s, 2.0 * v - d);
        new_fwd[i] = even + odd;
        new_bwd[i] = even - odd;
    }
}
