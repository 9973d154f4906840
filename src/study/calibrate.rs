//! A calibration, set up step by step.

use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::posterior::doubt::find_bounds;
use crate::fit::problem::method::Method;
use crate::fit::progress::OnProgress;
use crate::fit::search::nested::calibrate_nested;
use crate::fit::search::options::Options;
use crate::model::ModelError;
use crate::model::constraint::Given;
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
        let effects = [self.effects?];
        let mut options = self.options;
        // The first that concerns a parameter counts.
        let held = constraints(self.rig, self.runs, &effects, &self.hold);
        options.constraints.splice(0..0, held.into_iter().flatten());
        let [effects] = effects;
        let mut fit = calibrate_nested(self.rig, self.runs, &effects, &options, self.on_progress)?;
        find_bounds(&mut fit);
        Ok(fit)
    }
}
