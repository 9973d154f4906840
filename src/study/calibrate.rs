//! A calibration, set up step by step.

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::posterior::doubt::find_bounds;
use crate::fit::problem::method::Method;
use crate::fit::progress::OnProgress;
use crate::fit::search::calibrate::{calibrate, refine};
use crate::fit::search::options::Options;
use crate::model::ModelError;
use crate::model::constraint::{Constraint, Given};
use crate::model::effects::unsteady_friction::{SCALE_1D, SCALE_2D, in_one_dimension, in_two_dimensions};
use crate::model::effects::{Chosen, parse_list};
use crate::rig::Rig;
use crate::study::error::Result;
use crate::study::hold::{Hold, constraints};

/// Effects of a model: a list as on the command line (`"viscoelastic-wall:2,leak"`; `"none"` is the base model), or
/// effects chosen before.
pub trait Effects {
    /// The effects.
    ///
    /// # Errors
    /// An effect that does not exist, or that excludes another.
    fn chosen(self) -> std::result::Result<Vec<Chosen>, ModelError>;
}

impl Effects for &str {
    fn chosen(self) -> std::result::Result<Vec<Chosen>, ModelError> {
        parse_list(self)
    }
}

impl Effects for &[Chosen] {
    fn chosen(self) -> std::result::Result<Vec<Chosen>, ModelError> {
        Ok(self.to_vec())
    }
}

impl Effects for &Vec<Chosen> {
    fn chosen(self) -> std::result::Result<Vec<Chosen>, ModelError> {
        Ok(self.clone())
    }
}

impl Effects for &Chosen {
    fn chosen(self) -> std::result::Result<Vec<Chosen>, ModelError> {
        Ok(vec![self.clone()])
    }
}

/// A calibration that has not run yet; see [`Study::calibrate`](crate::Study::calibrate).
#[must_use = "a calibration does nothing until it is run"]
pub struct Calibrate<'a> {
    pub(crate) rig: &'a Rig,
    pub(crate) runs: &'a [RunData],
    pub(crate) on_progress: &'a OnProgress<'a>,
    pub(crate) effects: std::result::Result<Vec<Chosen>, ModelError>,
    pub(crate) hold: Vec<Hold>,
    pub(crate) options: Options,
    pub(crate) quasi_2d: bool,
}

impl Calibrate<'_> {
    /// Holds a parameter at a value, in the parameter's unit; one that each run has of its own is held in all of them.
    ///
    /// ```no_run
    /// # let study = surgescope::Study::open(["recordings/hdpe-creep.mcap"])?;
    /// let fit = study.calibrate("none").hold("closing_time_s", 0.1).run()?;
    /// assert!(fit.parameter("closing_time_s")?.held);
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    pub fn hold(mut self, name: &str, value: f64) -> Self {
        self.hold.push(Hold { name: name.to_owned(), lower: value, upper: value });
        self
    }

    /// Lets the search start from this value of a parameter.
    ///
    /// ```no_run
    /// # let study = surgescope::Study::open(["recordings/hdpe-creep.mcap"])?;
    /// let fit = study.calibrate("leak").start("leak_position_m", 60.0).run()?;
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    pub fn start(mut self, name: &str, value: f64) -> Self {
        self.options.starts_at.push(Given { name: name.to_owned(), run: None, value });
        self
    }

    /// Ends with the quasi-2D model: first the optimum in one dimension, with unsteady friction at the textbook's
    /// strength, then on from there with the velocity profile in place of that friction.
    ///
    /// ```no_run
    /// # let study = surgescope::Study::open(["recordings/hdpe-creep.mcap"])?;
    /// let fit = study.calibrate("viscoelastic-wall").quasi_2d().run()?;
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    pub fn quasi_2d(mut self) -> Self {
        self.quasi_2d = true;
        self
    }

    /// Chooses how to search.
    ///
    /// ```no_run
    /// # let study = surgescope::Study::open(["recordings/hdpe-creep.mcap"])?;
    /// use surgescope::fit::problem::method::Method;
    /// let fit = study.calibrate("viscoelastic-wall:2").method(Method::GlobalLocal).run()?;
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    pub fn method(mut self, method: Method) -> Self {
        self.options.method = method;
        self
    }

    /// Replaces all options; call it before the other setters.
    ///
    /// ```no_run
    /// # let study = surgescope::Study::open(["recordings/hdpe-creep.mcap"])?;
    /// use surgescope::fit::search::options::Options;
    /// let fit = study.calibrate("none").options(Options { most_reaches: 64, ..Options::default() }).run()?;
    /// assert!(fit.reaches <= 64);
    /// # Ok::<(), surgescope::Error>(())
    /// ```
    pub fn options(mut self, options: Options) -> Self {
        self.options = options;
        self
    }

    /// Fits the model.
    ///
    /// # Errors
    /// Effects that do not exist or exclude each other, a parameter that the model does not have, a model that cannot
    /// be simulated.
    pub fn run(self) -> Result<Fit> {
        let mut effects = [self.effects?];
        if self.quasi_2d {
            effects = effects.map(|effects| in_one_dimension(&effects));
        }
        let mut options = self.options;
        // The first that concerns a parameter counts.
        let held = constraints(self.rig, self.runs, &effects, &self.hold);
        options.constraints.splice(0..0, held.into_iter().flatten());
        let [effects] = effects;
        let textbook = |name: &str| Constraint { name: name.to_owned(), run: None, lower: 1.0, upper: 1.0 };
        // The parameter of the profile does not exist in one dimension.
        let of_profile: Vec<_> = options.constraints.extract_if(.., |c| self.quasi_2d && c.name == SCALE_2D).collect();
        options.constraints.extend(self.quasi_2d.then(|| textbook(SCALE_1D)));
        let mut fit = calibrate(self.rig, self.runs, &effects, &options, self.on_progress)?;
        if self.quasi_2d {
            // The factor of one friction stands where that of the other stood.
            options.constraints.retain(|c| c.name != SCALE_1D);
            options.constraints.extend(of_profile.into_iter().chain([textbook(SCALE_2D)]));
            let effects = in_two_dimensions(&fit.effects);
            fit = refine(self.rig, self.runs, &effects, &fit.values(), &options, self.on_progress)?;
        }
        find_bounds(&mut fit);
        Ok(fit)
    }
}
