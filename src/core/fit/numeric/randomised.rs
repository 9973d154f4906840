//! Draws of a density that data give: each is where the variables lead to data with an error of their own.
//!
//! The density is `exp(-½|u(x)|² - rest(x))` within bounds, where `u` are whitened data, no more of them than
//! variables. A valley that is bent in `x` is round in `u`: aim at standard normal data, and solve `u(x) = aim`. The
//! solutions have the density `exp(-½|u|²) |det ∂u/∂x|`, so a Metropolis step weighs them by `exp(-rest) / |det ∂u/∂x|`
//! (randomise-then-optimise: Bardsley, Solonen, Haario & Laine 2014, SIAM J. Sci. Comput. 36, A1895). Where `u` is
//! straight and the rest constant, every draw is taken.
//!
//! Variables that the data leave open within their bounds are not solved for. They are *given*: drawn from the
//! straightened density between their bounds, by steps along random lines (hit and run: Bélisle, Romeijn & Smith 1993,
//! Math. Oper. Res. 18, 255). The data that the others can reach are aimed at, and what the rest of the data say
//! enters the weight. Most steps propose all anew, the others stay near (preconditioned Crank-Nicolson: Cotter,
//! Roberts, Stuart & White 2013, Stat. Sci. 28, 424).
//!
//! Where a variable vanishes, such as the logarithm of a strength far down, it shows nothing, and its density is a plain
//! that hardly any aim leads to. Whoever is there has a great weight and would stay. So after each step one variable
//! moves alone, by any part of its range, as the density itself has it.
//!
//! Only one solution of each aim is found, the one to which Newton's steps lead from the fit: another basin that shows
//! the same data is not drawn.

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use crate::fit::numeric::population::normal;
use crate::fit::numeric::quantiles::Z_95;
use crate::fit::numeric::thresholds::{
    AIM_REACHED, LEAST_NORMAL_MOVE, LEAST_PART_ALONE, LINES_PER_VARIABLE, MOST_CUT_STEPS, MOST_SOLVING_STEPS,
    WHOLE_MOVE_SHARE,
};

/// What the variables show.
pub(crate) struct Shown {
    /// The whitened data.
    pub(crate) data: DVector<f64>,
    /// What else lowers the logarithm of the density.
    pub(crate) rest: f64,
}

impl Shown {
    fn log_density(&self) -> f64 {
        -0.5 * self.data.norm_squared() - self.rest
    }
}

/// A density that whitened data give.
pub(crate) trait Density: Sync {
    /// None where nothing can be computed.
    fn shown(&self, x: &[f64]) -> Option<Shown>;
    /// Slopes of the data, a column a variable.
    fn slopes(&self, x: &[f64]) -> Option<DMatrix<f64>>;
}

/// The variables in two parts: those that are given and those that are solved for.
struct Parts {
    centre: Vec<f64>,
    bounds: Vec<(f64, f64)>,
    given: Vec<usize>,
    solved: Vec<usize>,
    /// Orthonormal basis of the data that the solved variables reach, a column each.
    reached: DMatrix<f64>,
    /// Step of the solved variables for a step along each of these.
    back: DMatrix<f64>,
    /// Data at the centre, and their slopes by the given variables.
    data: DVector<f64>,
    by_given: DMatrix<f64>,
    /// What these two show beyond the data that are reached.
    beyond: DVector<f64>,
    beyond_by_given: DMatrix<f64>,
    /// Directions in which the given variables are about equally well known, a column each.
    lines: DMatrix<f64>,
}

impl Parts {
    /// A variable is given where, with those given already, a bound lies within 1.96 standard errors of the centre:
    /// the rule by which an interval is in doubt. None where no slope is finite.
    fn of(centre: &[f64], bounds: &[(f64, f64)], data: &DVector<f64>, slopes: &DMatrix<f64>) -> Option<Self> {
        let (mut given, mut solved): (Vec<usize>, Vec<usize>) = (Vec::new(), (0..centre.len()).collect());
        // Bounds as faint data, so that what is open has a finite error.
        let precision = slopes.transpose() * slopes + faint(&solved, bounds);
        loop {
            let covariance = Cholesky::new(precision.select_rows(&solved).select_columns(&solved))?.inverse();
            let reach = |(i, &a): (usize, &usize)| {
                let room = (centre[a] - bounds[a].0).min(bounds[a].1 - centre[a]);
                (i, Z_95 * covariance[(i, i)].sqrt() / room.max(f64::MIN_POSITIVE))
            };
            let widest = solved.iter().enumerate().map(reach).max_by(|a, b| a.1.total_cmp(&b.1));
            match widest {
                Some((i, reach)) if reach > 1.0 => given.push(solved.remove(i)),
                _ => break,
            }
            if solved.is_empty() {
                break;
            }
        }
        let qr = slopes.select_columns(&solved).qr();
        let (reached, back) = (qr.q(), qr.r().try_inverse()?);
        let by_given = slopes.select_columns(&given);
        let beyond = data - &reached * (reached.transpose() * data);
        let beyond_by_given = &by_given - &reached * (reached.transpose() * &by_given);
        let known = beyond_by_given.transpose() * &beyond_by_given;
        let known = known + faint(&given, bounds);
        let lines = Cholesky::new(known)?.inverse().cholesky()?.l();
        Some(Parts {
            centre: centre.to_vec(),
            bounds: bounds.to_vec(),
            given,
            solved,
            reached,
            back,
            data: data.clone(),
            by_given,
            beyond,
            beyond_by_given,
            lines,
        })
    }

    /// Moves the given variables along random lines, so that a draw of their straightened density remains one.
    fn slide(&self, given: &mut DVector<f64>, lines: usize, random: &mut fastrand::Rng) {
        for _ in 0..lines {
            let line = &self.lines * DVector::from_fn(self.given.len(), |_, _| normal(random));
            let (mut from, mut to) = (f64::NEG_INFINITY, f64::INFINITY);
            for (i, &a) in self.given.iter().enumerate().filter(|(i, _)| line[*i] != 0.0) {
                let ends = [self.bounds[a].0, self.bounds[a].1].map(|end| (end - self.centre[a] - given[i]) / line[i]);
                (from, to) = (from.max(ends[0].min(ends[1])), to.min(ends[0].max(ends[1])));
            }
            let along = &self.beyond_by_given * &line;
            let here = &self.beyond + &self.beyond_by_given * &*given;
            *given += line * between(-along.dot(&here), along.norm_squared(), (from.min(0.0), to.max(0.0)), random);
        }
        for (i, &a) in self.given.iter().enumerate() {
            given[i] = given[i].clamp(self.bounds[a].0 - self.centre[a], self.bounds[a].1 - self.centre[a]);
        }
    }

    /// Where the solved variables lead to these data, the given ones standing where they are: Broyden's steps, and the
    /// slopes of the place where those do not bring the data nearer.
    fn solve(&self, density: &impl Density, given: &DVector<f64>, aim: &DVector<f64>) -> Option<Place> {
        let mut at = self.centre.clone();
        self.given.iter().zip(given.iter()).for_each(|(&a, by)| at[a] += by);
        let aimed = |shown: &Shown| self.reached.transpose() * &shown.data;
        let mut back = self.back.clone();
        let mut step = &back * (aim - self.reached.transpose() * (&self.data + &self.by_given * given));
        let mut last: Option<(Shown, DVector<f64>)> = None;
        let mut cuts = 0;
        for _ in 0..MOST_SOLVING_STEPS {
            let mut to = at.clone();
            self.solved.iter().zip(step.iter()).for_each(|(&a, by)| to[a] += by);
            for (v, (lower, upper)) in to.iter_mut().zip(&self.bounds) {
                cuts += usize::from(*v < *lower || *v > *upper);
                *v = v.clamp(*lower, *upper);
            }
            if cuts > MOST_CUT_STEPS {
                return None;
            }
            let Some(shown) = density.shown(&to) else {
                cuts += 1;
                step *= 0.5;
                continue;
            };
            let missing = aim - aimed(&shown);
            if missing.norm() < AIM_REACHED {
                return self.place(density, to, shown, given.clone());
            }
            let nearer = last.as_ref().is_none_or(|(_, before)| missing.norm() < 0.5 * before.norm());
            if let Some((_, before)) = last.as_ref().filter(|_| nearer) {
                let moved = DVector::from_iterator(step.len(), self.solved.iter().map(|&a| to[a] - at[a]));
                let passed = &back * (before - &missing);
                let share = moved.dot(&passed);
                if share != 0.0 {
                    back += (&moved - &passed) * (moved.transpose() * &back) / share;
                }
            } else if last.is_some() {
                let slopes = density.slopes(&to)?;
                back = (self.reached.transpose() * slopes.select_columns(&self.solved)).try_inverse()?;
            }
            step = &back * &missing;
            at = to;
            last = Some((shown, missing));
        }
        None
    }

    /// The place of a solution, with its weight.
    fn place(&self, density: &impl Density, x: Vec<f64>, shown: Shown, given: DVector<f64>) -> Option<Place> {
        let aim = self.reached.transpose() * &shown.data;
        let slopes = density.slopes(&x)?.select_columns(&self.solved);
        let log_slope =
            (self.reached.transpose() * slopes).lu().u().diagonal().iter().map(|v| v.abs().ln()).sum::<f64>();
        let beyond = shown.data.norm_squared() - aim.norm_squared();
        let straight = (&self.beyond + &self.beyond_by_given * &given).norm_squared();
        let log_weight = 0.5 * (straight - beyond) - shown.rest - log_slope;
        log_weight.is_finite().then_some(Place { x, given, aim, log_density: shown.log_density(), log_weight })
    }
}

/// What the range of some variables says of them.
fn faint(of: &[usize], bounds: &[(f64, f64)]) -> DMatrix<f64> {
    DMatrix::from_diagonal(&DVector::from_iterator(of.len(), of.iter().map(|&a| (bounds[a].1 - bounds[a].0).powi(-2))))
}

/// A draw of `exp(slope t - ½ curvature t²)` between two ends.
fn between(slope: f64, curvature: f64, (from, to): (f64, f64), random: &mut fastrand::Rng) -> f64 {
    use statrs::distribution::{ContinuousCDF, Normal};
    let share = random.f64();
    let sd = curvature.sqrt().recip();
    if sd > 1e3 * (to - from) && slope.abs() * (to - from) < 1e-3 {
        return from + share * (to - from);
    }
    let (mean, standard) = (slope / curvature, Normal::standard());
    // Of the two tails, the lower one is known to more digits.
    let (side, low, high) = if from > mean { (-1.0, mean - to, mean - from) } else { (1.0, from - mean, to - mean) };
    let [least, most] = [low, high].map(|end| standard.cdf(end / sd));
    let drawn = side * sd * standard.inverse_cdf(least + (most - least) * share);
    (mean + drawn).clamp(from, to)
}

/// Where a chain stands.
#[derive(Debug, Clone)]
struct Place {
    x: Vec<f64>,
    /// Of the given variables, from the centre.
    given: DVector<f64>,
    /// Of the data that are aimed at.
    aim: DVector<f64>,
    log_density: f64,
    log_weight: f64,
}

/// A chain and the way it went.
#[derive(Debug, Clone)]
pub(crate) struct Chain {
    at: Option<Place>,
    /// Its place after each step.
    pub(crate) path: Vec<Vec<f64>>,
    /// Steps that it made, not those that it refused.
    pub(crate) moves: usize,
    random: fastrand::Rng,
}

/// Chains that know nothing of each other.
pub(crate) struct Chains<'a, D: Density> {
    density: &'a D,
    parts: Parts,
    pub(crate) chains: Vec<Chain>,
}

impl<'a, D: Density> Chains<'a, D> {
    /// So many chains of a density that is known at its `centre`; each begins with a draw of the straightened density
    /// where that leads to one. None where the slopes at the centre are not finite.
    pub(crate) fn new(density: &'a D, centre: &[f64], bounds: &[(f64, f64)], number: usize, seed: u64) -> Option<Self> {
        let shown = density.shown(centre)?;
        let slopes = density.slopes(centre)?;
        let parts = Parts::of(centre, bounds, &shown.data, &slopes)?;
        let mut random = fastrand::Rng::with_seed(seed);
        let chain = |_| Chain { at: None, path: Vec::new(), moves: 0, random: random.fork() };
        let chains = (0..number).map(chain).collect();
        Some(Chains { density, parts, chains })
    }

    /// Moves every chain once.
    pub(crate) fn step(&mut self) {
        let (density, parts) = (self.density, &self.parts);
        self.chains.par_iter_mut().for_each(|chain| chain.step(density, parts));
    }
}

impl Chain {
    fn step(&mut self, density: &impl Density, parts: &Parts) {
        let whole = self.at.is_none() || self.random.f64() < WHOLE_MOVE_SHARE;
        let by = if whole { 1.0 } else { LEAST_NORMAL_MOVE.powf(self.random.f64()) };
        let lines = if whole { LINES_PER_VARIABLE * parts.given.len() } else { parts.given.len().min(1) };
        let (mut given, aim) = match &self.at {
            Some(at) => (at.given.clone(), at.aim.clone()),
            None => (DVector::zeros(parts.given.len()), DVector::zeros(parts.solved.len())),
        };
        parts.slide(&mut given, lines, &mut self.random);
        let keep = (1.0 - by * by).sqrt();
        let aim = aim.map(|v| keep * v + by * normal(&mut self.random));
        if let Some(there) = parts.solve(density, &given, &aim) {
            let odds = self.at.as_ref().map_or(f64::INFINITY, |at| there.log_weight - at.log_weight);
            if self.random.f64().ln() < odds {
                self.at = Some(there);
                self.moves += 1;
            }
        }
        self.step_alone(density, parts);
        self.path.push(self.at.as_ref().map_or_else(|| parts.centre.clone(), |at| at.x.clone()));
    }

    /// Moves one variable alone.
    fn step_alone(&mut self, density: &impl Density, parts: &Parts) {
        let Some(at) = &self.at else { return };
        let a = self.random.usize(..at.x.len());
        let (lower, upper) = parts.bounds[a];
        let by = (upper - lower) * LEAST_PART_ALONE.powf(self.random.f64()) * normal(&mut self.random);
        let mut x = at.x.clone();
        x[a] += by;
        if !(lower..=upper).contains(&x[a]) {
            return;
        }
        let Some(shown) = density.shown(&x) else { return };
        if self.random.f64().ln() < shown.log_density() - at.log_density {
            let given = parts.given.iter().map(|&a| x[a] - parts.centre[a]);
            let given = DVector::from_iterator(parts.given.len(), given);
            self.at = parts.place(density, x, shown, given).or(self.at.take());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::numeric::convergence::Convergence;

    /// Data that are functions of the variables, with slopes by central differences.
    struct Made<F: Fn(&[f64]) -> Vec<f64> + Sync, R: Fn(&[f64]) -> f64 + Sync>(F, R);

    impl<F: Fn(&[f64]) -> Vec<f64> + Sync, R: Fn(&[f64]) -> f64 + Sync> Density for Made<F, R> {
        fn shown(&self, x: &[f64]) -> Option<Shown> {
            Some(Shown { data: DVector::from_vec((self.0)(x)), rest: (self.1)(x) })
        }
        fn slopes(&self, x: &[f64]) -> Option<DMatrix<f64>> {
            let column = |j: usize| {
                let [ahead, behind] = [1e-5, -1e-5].map(|by| {
                    let mut moved = x.to_vec();
                    moved[j] += by;
                    DVector::from_vec((self.0)(&moved))
                });
                (ahead - behind) / 2e-5
            };
            Some(DMatrix::from_columns(&(0..x.len()).map(column).collect::<Vec<_>>()))
        }
    }

    /// Sorted draws of each variable, of the second halves of eight chains, and how well they agree.
    fn drawn(
        density: &impl Density,
        centre: &[f64],
        bounds: &[(f64, f64)],
        steps: usize,
    ) -> Vec<(Vec<f64>, Convergence)> {
        let mut all = Chains::new(density, centre, bounds, 8, 1).unwrap();
        (0..steps).for_each(|_| all.step());
        let of = |j: usize| {
            let half = |c: &Chain| c.path[steps / 2..].iter().map(|x| x[j]).collect();
            let chains: Vec<Vec<f64>> = all.chains.iter().map(half).collect();
            let mut values = chains.concat();
            values.sort_by(f64::total_cmp);
            (values, Convergence::of(&chains, 2))
        };
        (0..centre.len()).map(of).collect()
    }

    fn moments(values: &[f64]) -> (f64, f64) {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64)
    }

    const WIDE: (f64, f64) = (-1e6, 1e6);

    /// Haario, Saksman & Tamminen's (1999) banana: `y = x₂ + b x₁² - b s²`, `x₁` of variance `s²`, `y` of variance 1.
    /// So `x₂` has mean 0 and variance `1 + 2 b² s⁴`: 18 standard deviations of `y` from end to end. In its data it is
    /// normal, and each draw is worth one.
    #[test]
    fn a_banana_is_drawn_with_its_moments() {
        let (b, s2) = (0.5, 4.0f64);
        let data = |x: &[f64]| vec![x[0] / s2.sqrt(), x[1] + b * x[0] * x[0] - b * s2];
        let draws = drawn(&Made(data, |_: &[f64]| 0.0), &[0.0, b * s2], &[WIDE; 2], 2000);
        let (mean, variance) = moments(&draws[0].0);
        assert!(mean.abs() < 0.1 && (variance / s2 - 1.0).abs() < 0.08, "{mean} {variance}");
        let (mean, variance) = moments(&draws[1].0);
        assert!(
            mean.abs() < 0.15 && (variance / (1.0 + 2.0 * b * b * s2 * s2) - 1.0).abs() < 0.15,
            "{mean} {variance}"
        );
        assert!(
            draws.iter().all(|(_, c)| c.r_hat < 1.01 && c.effective_draws > 2500.0),
            "{:?} {:?}",
            draws[0].1,
            draws[1].1
        );
    }

    /// A density that is not that of its straight data: `u = x + x³/10` with a density of `exp(-½u²)` in `x`, whose
    /// variance is that of a fine sum.
    #[test]
    fn what_the_slopes_change_is_weighed() {
        let data = |x: f64| x + 0.1 * x * x * x;
        let draws = drawn(&Made(|x: &[f64]| vec![data(x[0])], |_: &[f64]| 0.0), &[0.0], &[WIDE], 4000);
        let sum = |of: &dyn Fn(f64) -> f64| {
            (-6000..=6000).map(|i| f64::from(i) * 1e-3).map(|x| of(x) * (-0.5 * data(x).powi(2)).exp()).sum::<f64>()
        };
        let exact = sum(&|x| x * x) / sum(&|_| 1.0);
        let (mean, variance) = moments(&draws[0].0);
        assert!(mean.abs() < 0.04 && (variance / exact - 1.0).abs() < 0.05, "{mean} {variance} {exact}");
    }

    /// What lies across the data: `exp(-|x₁|)` more, by the same sum.
    #[test]
    fn the_rest_is_weighed() {
        let density = Made(|x: &[f64]| x.to_vec(), |x: &[f64]| x[0].abs());
        let draws = drawn(&density, &[0.0, 0.0], &[WIDE; 2], 4000);
        let sum = |of: &dyn Fn(f64) -> f64| {
            (-8000..=8000).map(|i| f64::from(i) * 1e-3).map(|x| of(x) * (-0.5 * x * x - x.abs()).exp()).sum::<f64>()
        };
        let exact = sum(&|x| x * x) / sum(&|_| 1.0);
        let (_, variance) = moments(&draws[0].0);
        assert!((variance / exact - 1.0).abs() < 0.06, "{variance} {exact}");
        assert!((moments(&draws[1].0).1 - 1.0).abs() < 0.06);
    }

    /// A normal density whose bound lies one standard deviation above its mean, bent and correlated with another
    /// variable: the quantiles of the first are those of statrs, whatever the other does.
    #[test]
    fn a_bound_cuts_the_density_off() {
        use statrs::distribution::{ContinuousCDF, Normal};
        let exact = Normal::standard();
        let above = 1.0 - exact.cdf(1.0);
        let density = Made(|x: &[f64]| vec![x[0], x[1] - x[0] * x[0]], |_: &[f64]| 0.0);
        let draws = drawn(&density, &[1.0, 1.0], &[(1.0, 100.0), WIDE], 4000);
        let (values, convergence) = &draws[0];
        assert!(convergence.r_hat < 1.01 && convergence.effective_draws > 2000.0, "{convergence:?}");
        assert!(values.iter().all(|v| *v >= 1.0));
        for share in [0.025, 0.5, 0.95] {
            let found = values[(share * values.len() as f64) as usize];
            let known = exact.inverse_cdf(1.0 - above * (1.0 - share));
            assert!((found - known).abs() < 0.05, "{share}: {found} {known}");
        }
    }

    /// The logarithm of a strength whose best value is two standard errors from none: below it the density is a plain
    /// of `exp(-2)` down to the bound, with half of all draws. Shares by Simpson's rule.
    #[test]
    fn a_strength_that_may_vanish_is_drawn_where_it_has_vanished() {
        let data = |x: f64| (x.exp() - 1.0) / 0.5;
        let density = Made(|x: &[f64]| vec![data(x[0])], |_: &[f64]| 0.0);
        let (least, most) = (-8.0, 2.0);
        let draws = drawn(&density, &[0.0], &[(least, most)], 4000);
        let (values, convergence) = &draws[0];
        let mass = |from: f64, to: f64| {
            let n = 2000;
            let at = |i: i32| (-0.5 * data(from + (to - from) * f64::from(i) / f64::from(n)).powi(2)).exp();
            let weight = |i: i32| if i == 0 || i == n { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
            (0..=n).map(|i| weight(i) * at(i)).sum::<f64>() * (to - from) / f64::from(3 * n)
        };
        assert!(convergence.r_hat < 1.02 && convergence.effective_draws > 500.0, "{convergence:?}");
        for end in [-6.0, -3.0, -0.5] {
            let found = values.partition_point(|v| *v < end) as f64 / values.len() as f64;
            let known = mass(least, end) / mass(least, most);
            assert!((found - known).abs() < 0.05, "below {end}: {found} {known}");
        }
    }

    /// Two variables of which the data show the sum, between bounds: the first is even over its range.
    #[test]
    fn what_is_open_is_even_between_its_bounds() {
        let density = Made(|x: &[f64]| vec![(x[0] + x[1]) / 0.01], |_: &[f64]| 0.0);
        let draws = drawn(&density, &[0.2, -0.2], &[(0.0, 1.0), (-10.0, 10.0)], 3000);
        let (values, convergence) = &draws[0];
        assert!(convergence.effective_draws > 2000.0, "{convergence:?}");
        for share in [0.1, 0.5, 0.9] {
            let found = values[(share * values.len() as f64) as usize];
            assert!((found - share).abs() < 0.03, "{share}: {found}");
        }
        let sums: (f64, f64) =
            moments(&draws[0].0.iter().zip(draws[1].0.iter().rev()).map(|(a, b)| a + b).collect::<Vec<_>>());
        assert!(sums.1 < 1e-3, "{sums:?}");
    }

    #[test]
    fn the_same_seed_draws_the_same() {
        let of = || drawn(&Made(|x: &[f64]| x.to_vec(), |_: &[f64]| 0.0), &[0.0; 3], &[WIDE; 3], 50);
        assert_eq!(
            of().into_iter().map(|d| d.0).collect::<Vec<_>>(),
            of().into_iter().map(|d| d.0).collect::<Vec<_>>()
        );
    }
}
