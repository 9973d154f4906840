//! A model beside the recordings of a study, at any values of its parameters.

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::problem::fit_problem::{FitProblem, Window};
use crate::fit::problem::hum::without_hum;
use crate::fit::problem::observed::Shown;
use crate::fit::search::calibrate::Begin;
use crate::fit::search::from_signals::follow;
use crate::fit::search::options::{Effort, Options};
use crate::model::Model;
use crate::model::constraint::{Constraint, Given};
use crate::model::effects::Chosen;
use crate::simulate::as_recorded::{AsRecordedError, values};
use crate::simulate::memory;
use crate::study::Study;
use crate::study::error::{Error, Result};
use crate::study::hold::options_of;

/// A model's runs at some values of its parameters.
pub struct Simulated {
    /// What each sensor shows at any time.
    pub shown: Shown,
    /// Reaches of the grid.
    pub reaches: usize,
}

impl Study {
    /// The model with these effects at the `given` values, the first that concerns a parameter counting; on a grid of
    /// about so many `reaches`.
    ///
    /// # Errors
    /// Values of parameters that the model does not have, a model that cannot be simulated.
    pub fn simulated(&self, effects: &[Chosen], given: &[Given], reaches: usize) -> Result<Simulated> {
        let mut model = Model::new(self.rig(), &self.runs()[0].conditions.water, effects);
        model.memory_limit_bytes = memory::limit_bytes();
        let window = Window { reaches, horizon_s: f64::INFINITY, stride: 1 };
        let mut problem = FitProblem::new(&model, self.runs(), window);
        let values = values_of(&problem, given)?;
        let shared = &values[..model.shared.len()];
        let reaches = model.fitting_reaches(shared, reaches.max(model.least_reaches(shared)));
        problem.set_window(Window { reaches, ..window });
        Ok(Simulated { shown: Shown::of(&problem, &values)?, reaches })
    }
}

impl Study {
    /// For each parameter of a fit the index of the effect that it belongs to; none for the base model's.
    pub fn owners(&self, fit: &Fit) -> Vec<Option<usize>> {
        let model = Model::new(self.rig(), &self.runs()[0].conditions.water, &fit.effects);
        let mut owners = vec![None; fit.parameters.len()];
        for effect in 0..fit.effects.len() {
            model.parameters_of(effect).for_each(|j| owners[j] = Some(effect));
        }
        owners
    }

    /// The model with these effects fitted from the `given` values on; what is not given starts where a fit would.
    ///
    /// # Errors
    /// As [`Study::simulated`].
    pub fn refined(&self, effects: &[Chosen], given: &[Given], options: &Options) -> Result<Fit> {
        let model = Model::new(self.rig(), &self.runs()[0].conditions.water, effects);
        let window = Window { reaches: 1, horizon_s: f64::INFINITY, stride: 1 };
        let values = values_of(&FitProblem::new(&model, self.runs(), window), given)?;
        Ok(self.fitter(options).fit(effects, Begin::At(&values), Effort::Whole)?)
    }

    /// The fit, or the one from the signals under the same bounds where that leaves less.
    ///
    /// # Errors
    /// A model that cannot be simulated.
    pub fn or_from_signals(&self, fit: Fit) -> Result<Fit> {
        let options = options_of(&fit);
        Ok(self.fitter(&options).or_from_signals(fit)?)
    }

    /// The values of a fitted model where the `moved` parameters stand elsewhere and the others have followed them, on
    /// a coarse grid that is coarser still while a parameter is `dragged`.
    ///
    /// # Errors
    /// As [`Study::simulated`]; a value out of its bounds.
    pub fn followed(&self, fit: &Fit, moved: &[Given], dragged: bool) -> Result<Vec<Given>> {
        let value = |p: &FittedParameter| moved.iter().find(|g| g.name == p.name).map(|g| g.value);
        let mut options = options_of(fit);
        options.constraints.retain(|c| moved.iter().all(|g| g.name != c.name));
        options.constraints.extend(fit.parameters.iter().filter_map(|p| {
            let value = value(p)?;
            Some(Constraint { name: p.name.clone(), run: p.run.clone(), lower: value, upper: value })
        }));
        let start: Vec<f64> = fit.parameters.iter().map(|p| value(p).unwrap_or(p.value)).collect();
        let values = follow(self.rig(), self.runs(), &fit.effects, &start, &options, dragged)?;
        let given = |(p, value): (&FittedParameter, f64)| Given { name: p.name.clone(), run: p.run.clone(), value };
        Ok(fit.parameters.iter().zip(values).map(given).collect())
    }
}

/// A value for each of the problem's parameters.
fn values_of(problem: &FitProblem, given: &[Given]) -> Result<Vec<f64>> {
    match values(problem, given) {
        Ok((values, _)) => Ok(values),
        Err(AsRecordedError::Model(error)) => Err(error.into()),
        Err(other) => Err(Error::Unshown(other)),
    }
}

impl Simulated {
    /// Root mean square of measured − model over all samples of all sensors from the start of each closure, m.
    pub fn rmse_m(&self, runs: &[RunData]) -> f64 {
        let (mut square, mut samples) = (0.0, 0usize);
        for (r, run) in runs.iter().enumerate() {
            for (s, sensor) in run.sensors.iter().enumerate() {
                let head_m = self.shown.head_m(r, s);
                let from = sensor.time_s.partition_point(|&t| t < self.shown.closure_start_s(r));
                let time_s = &sensor.time_s[from..];
                let left = time_s.iter().zip(&sensor.head_m[from..]).map(|(&t, measured)| measured - head_m(t));
                square +=
                    without_hum(sensor, time_s, left.collect()).into_iter().map(|error| error.powi(2)).sum::<f64>();
                samples += sensor.time_s.len() - from;
            }
        }
        (square / samples as f64).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn fitted(effects: &str, most_reaches: usize) -> (Study, Fit) {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/hdpe-creep.mcap");
        let study = Study::open([file]).unwrap();
        let options = Options { most_reaches, ..Options::default() };
        let fit = study.calibrate(effects).options(options).run().unwrap();
        (study, fit)
    }

    /// Beside a value that is wrong by little, the others take up most of the error, and what was moved stays.
    #[test]
    fn the_others_follow_a_parameter_that_is_moved() {
        let (study, fit) = fitted("viscoelastic-wall:1", 64);
        let name = "J1_per_GPa";
        let moved = [Given { name: name.into(), run: None, value: 1.2 * fit.parameter(name).unwrap().value }];
        let rmse = |given: &[Given]| study.simulated(&fit.effects, given, fit.reaches).unwrap().rmse_m(study.runs());
        let alone = rmse(&[&moved[..], &fit.given()].concat());
        for dragged in [true, false] {
            let followed = study.followed(&fit, &moved, dragged).unwrap();
            assert_eq!(followed.iter().find(|g| g.name == name).unwrap().value, moved[0].value);
            assert!(rmse(&followed) < 0.7 * alone, "{} of {alone}", rmse(&followed));
            assert!(rmse(&followed) > fit.pooled().0);
        }
    }

    #[test]
    fn at_the_values_of_a_fit_the_error_is_the_fits() {
        let (study, fit) = fitted("none", 32);
        let given = fit.given();
        let same = study.simulated(&fit.effects, &given, fit.reaches).unwrap();
        assert_eq!(same.reaches, fit.reaches);
        assert!((same.rmse_m(study.runs()) / fit.pooled().0 - 1.0).abs() < 1e-9);
        let mut slower = given.clone();
        slower.insert(0, Given { name: "wave_speed_m_s".into(), run: None, value: 300.0 });
        assert!(study.simulated(&fit.effects, &slower, fit.reaches).unwrap().rmse_m(study.runs()) > fit.pooled().0);
        slower[0].name = "leak_position_m".into();
        assert!(matches!(study.simulated(&fit.effects, &slower, fit.reaches), Err(Error::Unshown(_))));
    }
}
