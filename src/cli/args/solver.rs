//! `--solver`: in how many dimensions the flow is computed.

use clap::ValueEnum;

use crate::model::effects::Chosen;
use crate::model::effects::unsteady_friction::in_two_dimensions;

/// Option of commands that simulate.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct SolverChoice {
    /// In how many dimensions to compute the flow; quasi-2d replaces other unsteady friction.
    #[arg(long, value_enum, default_value_t = Solver::OneD)]
    solver: Solver,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Solver {
    /// The mean velocity alone, with the friction that effects give.
    #[value(name = "1d")]
    OneD,
    /// Also the velocity profile in rings at every node, whose wall shear is the friction
    /// (unsteady-friction/quasi-2d). A calibration ends with it, from the optimum in one dimension.
    #[value(name = "quasi-2d")]
    QuasiTwoD,
}

impl SolverChoice {
    /// Whether profiles are computed.
    pub fn quasi_2d(self) -> bool {
        self.solver == Solver::QuasiTwoD
    }

    /// The effects as they are simulated.
    pub fn effects(self, effects: &[Chosen]) -> Vec<Chosen> {
        if self.quasi_2d() { in_two_dimensions(effects) } else { effects.to_vec() }
    }
}
