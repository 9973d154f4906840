//! Thresholds of the numerical methods: what each means, and where it comes from.

/// Relative difference between the costs of the best and the worst member at which a population stops. Derived: a
/// hundredth of what moves a parameter by a tenth of its standard error, in a record of a million samples.
pub(crate) const SPREAD_TOLERANCE: f64 = 1e-10;
/// Least standard deviation of a variable in the first generation of CMA-ES, as a share of its range. Tuned; data
/// unknown.
pub(crate) const CMA_LEAST_SPREAD: f64 = 1e-4;

/// Members of the first population of the differential evolution, for each variable. Tuned; Tanabe & Fukunaga (2014)
/// take 18.
pub(crate) const MEMBERS_PER_VARIABLE: usize = 10;
/// Members that the population keeps at least: what the mutation needs (Tanabe & Fukunaga 2014).
pub(crate) const LEAST_MEMBERS: usize = 4;
/// Places of the memory of `F` and `CR` (Tanabe & Fukunaga 2014).
pub(crate) const MEMORY_SIZE: usize = 6;
/// Share of the population that counts as the best (Tanabe & Fukunaga 2014).
pub(crate) const BEST_SHARE: f64 = 0.11;
/// Size of the archive of replaced members, in populations (Tanabe & Fukunaga 2014).
pub(crate) const ARCHIVE_SIZE: f64 = 2.6;

/// Members of the micro-genetic algorithm (Krishnakumar 1989).
pub(crate) const MICRO_MEMBERS: usize = 5;
/// Bits for each variable: a thousandth of the window. Chosen.
pub(crate) const MICRO_BITS: usize = 10;
/// Share of bits in which the members differ from the best, below which the algorithm starts anew (5% in Carroll 1996).
pub(crate) const MICRO_ALIKE_SHARE: f64 = 0.05;
/// Width of the window when the budget is spent, as a share of the box. Tuned; data unknown.
pub(crate) const MICRO_LAST_WIDTH: f64 = 0.003;

/// Share of a step at which the curvature of the residuals along it is measured (Transtrum & Sethna 2012).
pub(crate) const ACCELERATION_PROBE: f64 = 0.1;
/// Largest acceleration that is trusted, in lengths of the step: twice that is Transtrum & Sethna's (2012) bound
/// of 0.75.
pub(crate) const MAX_ACCELERATION: f64 = 0.375;
/// Damping of the first step, in units of each column's square norm (Nielsen 1999).
pub(crate) const FIRST_DAMPING: f64 = 1e-3;
/// The same from a start that is near: there a damped step creeps along a flat valley, and a step that is too long
/// costs a trial but no Jacobian. Cost: with [`FIRST_DAMPING`] the open sets have the same answers.
pub(crate) const FIRST_DAMPING_NEAR: f64 = 1e-7;
/// By how much a step in vain raises the damping: as much as the best step lowers it. Chosen; Transtrum & Sethna (2012)
/// raise by 2 and lower by 3.
pub(crate) const DAMPING_RISE: f64 = 3.0;
/// Steps in a row that gain less than the tolerance, though more seems to be left, after which the descent stops.
/// Cost: with one stall the open sets have the same answers, at the price of more restarts.
pub(crate) const MAX_STALLS: usize = 8;

/// Share of the largest eigenvalue of a scaled normal matrix below which a combination of variables is undetermined.
/// Derived: finite differences are no more accurate.
pub(crate) const UNDETERMINED_EIGENVALUE: f64 = 1e-13;
/// Part of a variable in such a combination from which on the variable is undetermined, too. Chosen.
pub(crate) const UNDETERMINED_PART: f64 = 1e-4;

/// Share of a chain's steps that propose all anew. Chosen: in a bent valley nearly all of them are made.
pub(crate) const WHOLE_MOVE_SHARE: f64 = 0.8;
/// Shortest random step of the others, in standard deviations; the longest is one, and their logarithms are even.
/// Chosen.
pub(crate) const LEAST_NORMAL_MOVE: f64 = 0.2;
/// Least part of its range by which a variable moves alone, in standard deviations of the step; the most is all of it,
/// and their logarithms are even. Chosen.
pub(crate) const LEAST_PART_ALONE: f64 = 0.01;
/// Random lines along which given variables are drawn anew, for each of them. Chosen.
pub(crate) const LINES_PER_VARIABLE: usize = 10;
/// Distance from the data aimed at that counts as reached, in standard deviations. Chosen: it moves no quantile that a
/// thousand draws show.
pub(crate) const AIM_REACHED: f64 = 0.03;
/// Steps towards an aim before it is given up. Chosen: twice what most take.
pub(crate) const MOST_SOLVING_STEPS: usize = 12;
/// Steps of variables cut off at bounds or halved, after which the aim lies out of bounds. Chosen.
pub(crate) const MOST_CUT_STEPS: usize = 6;

/// Active sets that are tried at most, for each variable. Chosen: a guard against cycling.
pub(crate) const ACTIVE_SETS_PER_VARIABLE: usize = 5;
