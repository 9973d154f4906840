//! How effects contribute to the step of the line: terms along it, and outflow from its nodes.

/// The implicit parts of a line term: its coefficients of the new head and flow.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Implicit {
    /// Storage: multiplies the head.
    pub kappa: f64,
    /// Momentum: multiplies `u = B Q`.
    pub mu: f64,
}

/// A term of the equations along the line, computed once per step for all nodes.
///
/// In the notation of [`kernel`](crate::model::kernel): half of what the term takes over one reach and one step is
/// `κh - b` of head (storage) and `μu - d` (momentum) at the new time; `κ, μ` are constants of the segment, `b, d`
/// known before the step. Heads are deviations `h` from the steady state, in which `b` and, with `μ`, `d` must balance.
pub trait LineTerm: Send {
    /// Whether it adds to storage alone: no `μ`, no `d`, and it asks for no flows.
    fn is_storage_alone(&self) -> bool {
        false
    }
    /// `κ` and `μ` of a segment.
    fn implicit(&self, segment: usize) -> Implicit;
    /// Adds `b` and `d` of the first step, from the steady state; nothing by default.
    fn known(&self, segment: usize, storage: &mut [f64], momentum: &mut [f64]) {
        let _ = (segment, storage, momentum);
    }
    /// Advances with the new head deviations and `u` of all nodes, and adds `b` and `d` of the next step.
    fn advance(&mut self, h: &[f64], u: &[f64], storage: &mut [f64], momentum: &mut [f64]);
    /// The same for a term of storage alone, which sets `b` if it is the `first` of its kind.
    fn advance_storage(&mut self, h: &[f64], storage: &mut [f64], first: bool) {
        let _ = (h, storage, first);
    }
}

/// Takes water out of *every* node: gas spread along the pipe, cavities wherever the pressure falls.
///
/// At the inner nodes of a segment it is solved for all of them at once; at joints and at the valve it is a [`Shunt`].
///
/// [`Shunt`]: crate::model::node::Shunt
pub trait NodeField: Send {
    /// Solves `(1 + κ) h + c q(h) = s` at a segment's inner nodes for given `s`; `h` holds the old deviations (m) and
    /// receives the new ones, `q` receives the outflow (m³/s).
    fn inner(&mut self, segment: usize, one_plus_kappa: f64, c: f64, s: &[f64], h: &mut [f64], q: &mut [f64]);
}
