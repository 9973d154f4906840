//! Elementary effects: how much an output changes when one parameter alone takes a long step, from many places.
//!
//! M. D. Morris (1991), Technometrics 33(2):161-174: trajectories on a grid of four levels over the unit cube, each
//! parameter one step of 2/3 in random order and direction. The mean absolute effect is that of Campolongo, Cariboni
//! and Saltelli (2007), Environ. Model. Softw. 22:1509-1518. Effects are in the output's unit for a step over the whole
//! range of the parameter.

use serde::Serialize;

/// Levels of the grid.
const LEVELS: usize = 4;
/// The step, in the unit cube: levels / (2 (levels - 1)).
const STEP: f64 = LEVELS as f64 / (2.0 * (LEVELS - 1) as f64);

/// Trajectories through the unit cube.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// The points: each trajectory has one more than there are parameters.
    pub points: Vec<Vec<f64>>,
    /// The parameter that moves from each point to the next, for each trajectory.
    orders: Vec<Vec<usize>>,
}

/// Effects of one parameter on one output, in the output's unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Effects {
    /// Mean, with sign.
    pub mu: f64,
    /// Mean of the absolute effects: how much it matters.
    pub mu_star: f64,
    /// Standard error of the mean of absolute effects.
    pub mu_star_error: f64,
    /// Standard deviation: how much the effect depends on its place, by curvature or interaction.
    pub sigma: f64,
    /// Trajectories that have the output at both ends of the step.
    pub used: usize,
}

/// Random trajectories over `parameters` parameters.
pub fn design(parameters: usize, trajectories: usize, seed: u64) -> Design {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut points = Vec::with_capacity(trajectories * (parameters + 1));
    let mut orders = Vec::with_capacity(trajectories);
    for _ in 0..trajectories {
        let up: Vec<bool> = (0..parameters).map(|_| rng.bool()).collect();
        // Starts from which a step stays within the cube.
        let starts = LEVELS / 2;
        let mut point: Vec<f64> = up
            .iter()
            .map(|&up| rng.usize(..starts) as f64 / (LEVELS - 1) as f64 + if up { 0.0 } else { STEP })
            .collect();
        let mut order: Vec<usize> = (0..parameters).collect();
        rng.shuffle(&mut order);
        points.push(point.clone());
        for &moved in &order {
            point[moved] += if up[moved] { STEP } else { -STEP };
            points.push(point.clone());
        }
        orders.push(order);
    }
    Design { points, orders }
}

impl Design {
    /// Effects of each parameter on an output, from its value at each point; values that are not finite are left out.
    ///
    /// # Panics
    /// If there is not one value per point.
    pub fn effects(&self, values: &[f64]) -> Vec<Effects> {
        assert_eq!(values.len(), self.points.len(), "one value a point");
        let parameters = self.orders.first().map_or(0, Vec::len);
        let mut effects = vec![Vec::new(); parameters];
        for (t, order) in self.orders.iter().enumerate() {
            let first = t * (parameters + 1);
            for (step, &moved) in order.iter().enumerate() {
                let (a, b) = (first + step, first + step + 1);
                let effect = (values[b] - values[a]) / (self.points[b][moved] - self.points[a][moved]);
                if effect.is_finite() {
                    effects[moved].push(effect);
                }
            }
        }
        effects.iter().map(|e| Effects::of(e)).collect()
    }
}

impl Effects {
    fn of(effects: &[f64]) -> Effects {
        let absolute: Vec<f64> = effects.iter().map(|e| e.abs()).collect();
        let (mu, sigma) = mean_and_deviation(effects);
        let (mu_star, spread) = mean_and_deviation(&absolute);
        let mu_star_error = spread / (effects.len() as f64).sqrt();
        Effects { mu, mu_star, mu_star_error, sigma, used: effects.len() }
    }
}

fn mean_and_deviation(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, variance.sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_trajectory_moves_each_parameter_once_within_the_cube() {
        let design = design(5, 40, 3);
        assert_eq!(design.points.len(), 40 * 6);
        for trajectory in design.points.chunks(6) {
            let mut moved: Vec<usize> = trajectory
                .windows(2)
                .map(|w| {
                    let changed: Vec<usize> = (0..5).filter(|&i| w[0][i] != w[1][i]).collect();
                    assert_eq!(changed.len(), 1);
                    changed[0]
                })
                .collect();
            moved.sort_unstable();
            assert_eq!(moved, [0, 1, 2, 3, 4]);
            assert!(trajectory.iter().flatten().all(|x| (-1e-12..=1.0 + 1e-12).contains(x)));
        }
        assert_eq!(design, super::design(5, 40, 3));
        assert_ne!(design, super::design(5, 40, 4));
    }

    #[test]
    fn a_plane_has_its_slopes_and_no_spread() {
        let design = design(3, 10, 1);
        let plane: Vec<f64> = design.points.iter().map(|x| 2.0 * x[0] - 3.0 * x[1]).collect();
        let effects = design.effects(&plane);
        for (effect, slope) in effects.iter().zip([2.0, -3.0, 0.0_f64]) {
            assert!((effect.mu - slope).abs() < 1e-12 && (effect.mu_star - slope.abs()).abs() < 1e-12);
            assert!(effect.sigma < 1e-12 && effect.used == 10, "{effect:?}");
        }
    }

    #[test]
    fn curvature_and_interaction_show_as_spread_and_gaps_are_left_out() {
        let design = design(2, 400, 1);
        let mut values: Vec<f64> = design.points.iter().map(|x| x[0] * x[1]).collect();
        let effects = design.effects(&values);
        // The other parameter takes the levels 0, 1/3, 2/3, 1 equally often: mean 1/2, standard deviation sqrt(5)/6.
        assert!((effects[0].mu - 0.5).abs() < 3.0 * effects[0].mu_star_error, "{effects:?}");
        assert!((effects[0].sigma - 5f64.sqrt() / 6.0).abs() < 0.03, "{effects:?}");
        values[0] = f64::NAN;
        let gap = design.effects(&values);
        assert_eq!(gap.iter().map(|e| e.used).sum::<usize>(), 799);
    }
}
