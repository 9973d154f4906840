//! Thresholds of posteriors: what each means, and where it comes from.

/// Chains, in two groups that are compared. Chosen.
pub(crate) const CHAINS: usize = 8;
/// R̂ up to which chains have met, where many draws were asked for (Vehtari et al. 2021).
pub(crate) const CONVERGED_R_HAT: f64 = 1.01;
/// Rise of R̂² for one effective draw, at which one set of chains in a thousand that have met would be refused.
/// Derived: the means of four half groups scatter as χ² of three degrees of freedom, of which 16.3 is the point,
/// over three, and each has a quarter of the draws.
pub(crate) const R_HAT_SCATTER: f64 = 21.7;
/// Steps before the chains are first looked at. Chosen.
pub(crate) const FIRST_SWEEPS: usize = 30;
/// Growth of their number from one look to the next. Chosen.
pub(crate) const SWEEPS_GROWTH: f64 = 1.25;
/// Steps at most, for each effective draw that is asked for. Chosen: several times what bounds and a bent valley took.
pub(crate) const MOVES_PER_DRAW: usize = 100;
/// Draws that a fit keeps, or as many as were asked for where those are more. Chosen: as many as a chart shows.
pub(crate) const KEPT_DRAWS: usize = 1000;
/// Density at a bound, as a share of the highest, from which on the bound belongs to the interval. Derived:
/// `exp(-3.84/2)`, where a profile's interval ends.
pub(crate) const BOUND_DENSITY: f64 = 0.1465;
/// Share of the draws over which a density is averaged to compare it with that at a bound. Chosen.
pub(crate) const DENSITY_WINDOW: f64 = 0.05;
