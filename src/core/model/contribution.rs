//! How effects contribute to the step of the line: terms along it, and water taken out of its nodes.

/// The implicit parts of a line term: the shares of head and of flow that it adds at the new time.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Implicit {
    /// Storage: multiplies the head.
    pub kappa: f64,
    /// Momentum: multiplies `u = B Q`.
    pub mu: f64,
}

/// A term of the equations along the line, computed once a step over all nodes of a segment.
///
/// In the notation of [`kernel`](crate::model::kernel): half of what the term takes over one reach and one step is `κh - b` of head (storage)
/// and `μu - d` (momentum) at the new time; `κ, μ` are constants of the segment, `b, d` known before the step. Heads are deviations
/// `h` from the steady state, in which `b` and, with `μ`, `d` must balance.
pub trait LineTerm: Send {
    /// `κ` and `μ` of a segment.
    fn implicit(&self, segment: usize) -> Implicit;
    /// Adds `b` and `d` of the first step, from the steady state; nothing by default.
    fn known(&self, segment: usize, storage: &mut [f64], momentum: &mut [f64]) {
        let _ = (segment, storage, momentum);
    }
    /// Takes in the new head deviations and `u` of a segment's nodes and adds `b` and `d` of the step to come.
    fn advance(&mut self, segment: usize, h: &[f64], u: &[f64], storage: &mut [f64], momentum: &mut [f64]);
}

/// What takes water out of *every* node: gas spread along the pipe, cavities wherever the pressure falls.
///
/// At the inner nodes of a segment it is solved for all of them at once; at joints and at the valve it is a [`Shunt`].
///
/// [`Shunt`]: crate::model::node::Shunt
pub trait NodeField: Send {
    /// Solves `(1 + κ) h + c q(h) = s` at a segment's inner nodes, whose `s` and deviations `h` (m) are given; `q(h)` is the
    /// outflow (m³/s), which is left in `q` beside the new `h`.
    fn inner(&mut self, segment: usize, one_plus_kappa: f64, c: f64, s: &[f64], h: &mut [f64], q: &mut [f64]);
}
