//! The two-element walls that the paper studies.

use surgescope::sensitivity::subject::Subject;

/// The wall of the paper's multi-parameter analysis.
pub const PAPER: Wall = Wall { values: [0.1, 0.0225, 1.5, 1.1] };

/// A two-element wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wall {
    /// J1 (1/GPa), τ1 (s), J2, τ2.
    pub values: [f64; 4],
}

impl Wall {
    /// The same with other values of one element, 0 or 1.
    pub fn with(mut self, element: usize, compliance_per_gpa: f64, tau_s: f64) -> Wall {
        self.values[2 * element] = compliance_per_gpa;
        self.values[2 * element + 1] = tau_s;
        self
    }

    /// All values under study with this wall in them.
    pub fn within(self, subject: &Subject) -> Vec<f64> {
        let mut values = subject.values.clone();
        let at = subject.model.effects_from();
        values[at..at + 4].copy_from_slice(&self.values);
        values
    }
}
