//! Thresholds of posteriors: what each means, and where it comes from.

/// Walkers of an ensemble for each variable, at least (ter Braak 2006).
pub(crate) const WALKERS_PER_VARIABLE: usize = 2;
/// Fewest walkers of an ensemble. Chosen.
pub(crate) const LEAST_WALKERS: usize = 24;
/// Spread of the walkers' starts, in standard errors: wider than the posterior, so that R̂ sees chains that have not
/// yet met (Gelman & Rubin 1992).
pub(crate) const START_SPREAD: f64 = 1.5;
/// Factor on it where nothing can be simulated so far away. Chosen.
pub(crate) const START_NEARER: f64 = 0.9;
/// The least that is tried. Chosen.
pub(crate) const LEAST_START_SPREAD: f64 = 1e-3;
/// Random lines along which a start is drawn, for each variable. Chosen.
pub(crate) const LINES_PER_VARIABLE: usize = 10;
/// Share of a variable's range over which walkers start where the data leave it open. Chosen.
pub(crate) const OPEN_START_SHARE: f64 = 0.1;
/// R̂ up to which chains have met, where many draws were asked for (Vehtari et al. 2021).
pub(crate) const CONVERGED_R_HAT: f64 = 1.01;
/// Rise of R̂² for one effective draw, at which one set of chains in a thousand that have met would be refused.
/// Derived: the means of four half ensembles scatter as χ² of three degrees of freedom, of which 16.3 is the point,
/// over three, and each has a quarter of the draws.
pub(crate) const R_HAT_SCATTER: f64 = 21.7;
/// Sweeps before the chains are first looked at. Chosen.
pub(crate) const FIRST_SWEEPS: usize = 60;
/// Growth of their number from one look to the next. Chosen.
pub(crate) const SWEEPS_GROWTH: f64 = 1.5;
/// Moves at most, for each effective draw that is asked for. Chosen: twice what a compliance that trades with a time
/// beyond the record took.
pub(crate) const MOVES_PER_DRAW: usize = 2000;
/// Draws that a fit keeps. Chosen: as many as a chart shows.
pub(crate) const KEPT_DRAWS: usize = 1000;
/// Density at a bound, as a share of the highest, from which on the bound belongs to the interval. Derived:
/// `exp(-3.84/2)`, where a profile's interval ends.
pub(crate) const BOUND_DENSITY: f64 = 0.1465;
/// Share of the draws over which a density is averaged to compare it with that at a bound. Chosen.
pub(crate) const DENSITY_WINDOW: f64 = 0.05;
