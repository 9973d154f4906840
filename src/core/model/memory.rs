//! Memory that a simulation needs, computed before it starts.

use crate::model::error::ModelError;

/// Default limit of a simulation's memory.
pub const USUAL_LIMIT_BYTES: f64 = 4.0 * (1u64 << 30) as f64;

/// Numbers that the base model keeps per node: waves, heads, flows, contributions of terms.
const PER_NODE: usize = 12;

/// Counts of a simulation's numbers, all of 8 bytes; floating point, because a request may exceed any integer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Need {
    /// Time steps.
    pub steps: f64,
    /// Numbers kept per step: probes, entries of the energy balance.
    pub per_step: usize,
    /// Nodes of the grid.
    pub nodes: usize,
    /// Numbers that effects keep per node.
    pub effects_per_node: usize,
}

impl Need {
    /// Bytes in all.
    pub fn bytes(&self) -> f64 {
        let grid = self.nodes as f64 * (PER_NODE + self.effects_per_node) as f64;
        8.0 * (grid + self.steps * self.per_step as f64)
    }

    /// Refuses a simulation that needs more than `limit_bytes`.
    ///
    /// # Errors
    /// [`ModelError::TooLarge`].
    pub fn check(&self, limit_bytes: f64) -> Result<(), ModelError> {
        let bytes = self.bytes();
        if bytes <= limit_bytes {
            return Ok(());
        }
        let gib = |bytes: f64| bytes / f64::from(1 << 30);
        Err(ModelError::TooLarge { steps: self.steps, nodes: self.nodes, gib: gib(bytes), limit_gib: gib(limit_bytes) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grid_and_history_count() {
        let need = Need { steps: 1e6, per_step: 3, nodes: 1001, effects_per_node: 8 };
        assert_eq!(need.bytes(), 8.0 * (3e6 + 1001.0 * 20.0));
        assert!(need.check(need.bytes()).is_ok());
        let refusal = need.check(0.5 * need.bytes()).unwrap_err().to_string();
        assert!(refusal.contains("1000000 steps on 1001 nodes"), "{refusal}");
        assert!(Need { steps: f64::INFINITY, ..need }.check(1e18).is_err());
    }
}
