//! A wave that is delayed by a number of steps that need not be whole, and a reach that delays its waves so.
//!
//! They pass a first-order all-pass filter, `y = η x + s`, `s⁺ = x - η y`, `η = (1 - D)/(1 + D)`: at low
//! frequencies a delay of `D` steps (Laakso et al. 1996, IEEE Signal Process. Mag. 13(1):30-60), with an error in phase
//! of third order in the step. It has gain 1 at every frequency, and the reach keeps its impedance: nothing is
//! reflected, and no energy is lost. `y² + s⁺²/(1 - η²) = x² + s²/(1 - η²)`.

use crate::model::grid::Grid;

/// The filter of one wave.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AllPass {
    eta: f64,
    kept: f64,
}

impl AllPass {
    /// A delay of so many steps, half a step to one and a half, of a wave that has stood still.
    pub(crate) fn new(steps: f64, wave: f64) -> AllPass {
        let eta = (1.0 - steps) / (1.0 + steps);
        AllPass { eta, kept: (1.0 - eta) * wave }
    }

    /// What leaves the filter as a wave enters it.
    #[inline(always)]
    pub(crate) fn pass(&mut self, wave: f64) -> f64 {
        let passed = self.eta * wave + self.kept;
        self.kept = wave - self.eta * passed;
        passed
    }

    /// The kept wave, with the energy of a wave on its way.
    fn wave(self) -> f64 {
        self.kept / (1.0 - self.eta * self.eta).sqrt()
    }
}

/// The filters of one late reach, one for each direction.
pub(crate) struct Late {
    /// The segment that is the reach.
    pub(crate) segment: usize,
    nodes: [usize; 2],
    /// Downstream and upstream.
    filters: [AllPass; 2],
}

impl Late {
    /// Those of a grid, where the waves `fwd` and `bwd` have stood still.
    pub(crate) fn of(grid: &Grid, fwd: &[f64], bwd: &[f64]) -> Vec<Late> {
        let late = grid.segments.iter().enumerate().filter(|(_, s)| s.late > 0.0);
        late.map(|(segment, s)| {
            let nodes = [s.offset, s.offset + 1];
            let filters = [fwd[nodes[0]], bwd[nodes[1]]].map(|wave| AllPass::new(s.late, wave));
            Late { segment, nodes, filters }
        })
        .collect()
    }

    /// Delays the waves on their way into the reach's other end.
    #[inline(always)]
    pub(crate) fn pass(&mut self, fwd: &mut [f64], bwd: &mut [f64]) {
        for (wave, filter) in [&mut fwd[self.nodes[0]], &mut bwd[self.nodes[1]]].into_iter().zip(&mut self.filters) {
            *wave = filter.pass(*wave);
        }
    }

    /// The kept waves, downstream and upstream, with the energy of waves on their way.
    pub(crate) fn waves(&self) -> [f64; 2] {
        self.filters.map(AllPass::wave)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn late(steps: f64) -> Late {
        Late { segment: 0, nodes: [0, 1], filters: [AllPass::new(steps, 0.0); 2] }
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
