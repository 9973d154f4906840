//! A reach that takes a wave longer than one step, by a number of steps that need not be whole.
//!
//! Its waves pass a first-order all-pass filter, `y = η x + s`, `s⁺ = x - η y`, `η = (1 - D)/(1 + D)`: at low
//! frequencies a delay of `D` steps (Laakso et al. 1996, IEEE Signal Process. Mag. 13(1):30-60), with an error in phase
//! of third order in the step. It has gain 1 at every frequency, and the reach keeps its impedance: nothing is
//! reflected, and no energy is lost. `y² + s⁺²/(1 - η²) = x² + s²/(1 - η²)`.

use crate::model::grid::Grid;

/// The filters of one late reach, one for each direction.
pub(crate) struct Late {
    /// The segment that is the reach.
    pub(crate) segment: usize,
    nodes: [usize; 2],
    eta: f64,
    /// What the filters keep, downstream and upstream.
    kept: [f64; 2],
}

impl Late {
    /// Those of a grid, where the waves `fwd` and `bwd` have stood still.
    pub(crate) fn of(grid: &Grid, fwd: &[f64], bwd: &[f64]) -> Vec<Late> {
        let late = grid.segments.iter().enumerate().filter(|(_, s)| s.late > 0.0);
        late.map(|(segment, s)| {
            let nodes = [s.offset, s.offset + 1];
            let eta = (1.0 - s.late) / (1.0 + s.late);
            let kept = [fwd[nodes[0]], bwd[nodes[1]]].map(|wave| (1.0 - eta) * wave);
            Late { segment, nodes, eta, kept }
        })
        .collect()
    }

    /// Delays the waves on their way into the reach's other end.
    #[inline(always)]
    pub(crate) fn pass(&mut self, fwd: &mut [f64], bwd: &mut [f64]) {
        for (wave, kept) in [&mut fwd[self.nodes[0]], &mut bwd[self.nodes[1]]].into_iter().zip(&mut self.kept) {
            let passed = self.eta * *wave + *kept;
            *kept = *wave - self.eta * passed;
            *wave = passed;
        }
    }

    /// The kept waves, downstream and upstream, with the energy of waves on their way.
    pub(crate) fn waves(&self) -> [f64; 2] {
        self.kept.map(|kept| kept / (1.0 - self.eta * self.eta).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn late(steps: f64) -> Late {
        Late { segment: 0, nodes: [0, 1], eta: (1.0 - steps) / (1.0 + steps), kept: [0.0; 2] }
    }

    #[test]
    fn a_slow_wave_is_delayed_by_its_steps_and_no_energy_is_lost() {
        for steps in [0.3, 0.5, 1.0, 1.31, 1.5] {
            let mut filter = late(steps);
            let (turn, mut energy) = (0.02, 0.0);
            let wave = |n: f64| (turn * n).sin();
            for n in 0..400 {
                let (mut fwd, mut bwd) = ([wave(f64::from(n)), 0.0], [0.0, 0.0]);
                energy += fwd[0] * fwd[0];
                filter.pass(&mut fwd, &mut bwd);
                energy -= fwd[0] * fwd[0];
                assert!((energy - filter.waves()[0].powi(2)).abs() < 1e-12, "{steps} {n}");
                if n > 60 {
                    let off = (fwd[0] - wave(f64::from(n) - steps)).abs();
                    assert!(off < turn.powi(3), "{steps} {n}: {off}");
                }
            }
        }
    }

    #[test]
    fn a_whole_step_is_exact() {
        let mut filter = late(1.0);
        let mut last = 0.0;
        for n in 0..20 {
            let x = f64::from(n * n % 7);
            let (mut fwd, mut bwd) = ([x, 0.0], [0.0, -x]);
            filter.pass(&mut fwd, &mut bwd);
            assert_eq!((fwd[0], bwd[1]), (last, -last));
            last = x;
        }
    }
}
