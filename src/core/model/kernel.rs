//! The step of the interior nodes: loops over slices, nothing else. They are inlined into the loop over time, which is
//! compiled for wide registers.
//!
//! Heads are deviations `h = H - H0(x)` from the steady state: storage terms want them so, and what the steady flow
//! loses over a reach, `R0`, drops out of them. Each node keeps the two waves that leave it, `fwd` downstream and `bwd`
//! upstream. With the waves `Cp`, `Cm` that arrive, `S = (Cp + Cm)/2`, `D = (Cp - Cm)/2`, the two characteristic
//! equations, each averaged over both ends of its characteristic, separate at a node of a uniform pipe into
//!
//! ```text
//! head   h (1 + κ) = S + b                    κ, b: storage in the wall and the like, implicit and known part
//! flow   u (1 + μ) + ½R(u/B) = D + ½R0 + d    u = B Q; μ, d: the same for momentum (unsteady friction)
//! waves  fwd = 2h + 2u - Cp,  bwd = 2h - 2u - Cm
//! ```
//!
//! The trapezoidal rule is hidden in `2X - incoming`: what a term takes from the arriving waves at the new time it
//! takes once more from the leaving ones. The loops reckon in `w = 2u`, which saves the halves.

use crate::model::friction::NodeFriction;

/// Elastic interior with steady friction: nodes `1..n-1` of a segment, from the old leaving waves to the new.
///
/// `friction` is that of `w`, `steady_loss` is `R0`.
#[inline(always)]
pub fn elastic<F: NodeFriction>(
    fwd: &[f64],
    bwd: &[f64],
    new_fwd: &mut [f64],
    new_bwd: &mut [f64],
    friction: &F,
    steady_loss: f64,
) {
    let Some(m) = fwd.len().checked_sub(2) else { return };
    let (cp, cm) = (&fwd[..m], &bwd[2..][..m]);
    let (new_fwd, new_bwd) = (&mut new_fwd[1..][..m], &mut new_bwd[1..][..m]);
    for i in 0..m {
        let w = friction.solve(cp[i] - cm[i] + steady_loss);
        new_fwd[i] = cm[i] + w;
        new_bwd[i] = cp[i] - w;
    }
}

/// Interior with terms of storage alone: also gives the heads at nodes `1..n-1`. `known` is `b` at each node, `κ` and
/// `R0`.
#[inline(always)]
pub fn with_storage<F: NodeFriction>(
    fwd: &[f64],
    bwd: &[f64],
    new_fwd: &mut [f64],
    new_bwd: &mut [f64],
    head: &mut [f64],
    (storage, kappa, steady_loss): (&[f64], f64, f64),
    friction: &F,
) {
    let Some(m) = fwd.len().checked_sub(2) else { return };
    let (cp, cm) = (&fwd[..m], &bwd[2..][..m]);
    let (new_fwd, new_bwd) = (&mut new_fwd[1..][..m], &mut new_bwd[1..][..m]);
    let (head, storage) = (&mut head[1..][..m], &storage[1..][..m]);
    let by_kappa = 1.0 / (1.0 + kappa);
    for i in 0..m {
        let twice_h = (cp[i] + cm[i] + 2.0 * storage[i]) * by_kappa;
        let w = friction.solve(cp[i] - cm[i] + steady_loss);
        head[i] = 0.5 * twice_h;
        new_fwd[i] = twice_h + w - cp[i];
        new_bwd[i] = twice_h - w - cm[i];
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
    /// What the steady flow loses over a reach, `R0`, m.
    pub steady_loss: f64,
}

/// Interior with line terms; also gives head and `u = B Q` at nodes `1..n-1`. `friction` is that of `w`, of the reach
/// divided by `1 + μ`.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // slices of one segment
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
    let steady_loss = terms.steady_loss;
    let (by_kappa, by_mu) = (1.0 / (1.0 + terms.kappa), 1.0 / (1.0 + terms.mu));
    for i in 0..m {
        let twice_h = (cp[i] + cm[i] + 2.0 * storage[i]) * by_kappa;
        let w = friction.solve((cp[i] - cm[i] + steady_loss + 2.0 * momentum[i]) * by_mu);
        head[i] = 0.5 * twice_h;
        u[i] = 0.5 * w;
        new_fwd[i] = twice_h + w - cp[i];
        new_bwd[i] = twice_h - w - cm[i];
    }
}

/// `S + b` at nodes `1..n-1` of a segment, from which a node field finds head and outflow.
#[inline(always)]
pub fn mean_arriving(fwd: &[f64], bwd: &[f64], storage: &[f64], mean: &mut [f64]) {
    let m = mean.len();
    let (cp, cm, storage) = (&fwd[..m], &bwd[2..][..m], &storage[1..][..m]);
    for i in 0..m {
        mean[i] = 0.5 * (cp[i] + cm[i]) + storage[i];
    }
}

/// Interior where water is taken out of every node, as [`with_terms`]: from the heads and outflows of nodes `1..n-1` to
/// their flows and waves. The flows on the two sides of a node differ by the outflow; `half_b` is `B/2`.
#[inline(always)]
#[allow(clippy::too_many_arguments)] // slices of one segment
pub fn with_outflow<F: NodeFriction>(
    fwd: &[f64],
    bwd: &[f64],
    new_fwd: &mut [f64],
    new_bwd: &mut [f64],
    head: &[f64],
    outflow: &[f64],
    u: &mut [f64],
    half_b: f64,
    terms: &Terms,
    friction: &F,
) {
    let Some(m) = fwd.len().checked_sub(2) else { return };
    let (cp, cm) = (&fwd[..m], &bwd[2..][..m]);
    let (new_fwd, new_bwd) = (&mut new_fwd[1..][..m], &mut new_bwd[1..][..m]);
    let (head, outflow, u) = (&head[1..][..m], &outflow[1..][..m], &mut u[1..][..m]);
    let (storage, momentum) = (&terms.storage[1..][..m], &terms.momentum[1..][..m]);
    let by_mu = 1.0 / (1.0 + terms.mu);
    for i in 0..m {
        let w = friction.solve((cp[i] - cm[i] + terms.steady_loss + 2.0 * momentum[i]) * by_mu);
        let taken = 2.0 * half_b * outflow[i];
        let twice_kept = 2.0 * (storage[i] - terms.kappa * head[i]);
        u[i] = 0.5 * w;
        new_bwd[i] = cp[i] + (twice_kept - w - taken);
        new_fwd[i] = cm[i] + (twice_kept + w - taken);
    }
}
