//! What a person, or a script, sees of a calibration: terminal tables, one JSON document, one self-contained HTML page.
//!
//! The loop of the program is to fit a model, see where it fails, add an effect and fit again. A report therefore shows
//! a list of [`Stage`]s, the start model first, and lets the error of each be compared with the noise of the recording.
//!
//! | folder | what it makes |
//! | --- | --- |
//! | [`text`] | tables, numbers and small plots in plain text |
//! | [`view`] | what is worth showing of a fit, whatever shows it: curves, where a model fails, the verdict in a sentence |
//! | [`svg`] | static charts, for the page in print and for any other plot |
//! | [`html`](mod@html) | the frame of a page, tables, escapes |
//! | [`notebook`] | pieces of that page, for a cell of a notebook |
//! | [`page`] | the page of a calibration, a prediction or a diagnosis, from the pieces of its subject |
//! | the others | one subject each: its text, its JSON and its HTML side by side |

pub mod advice;
pub mod calibration;
pub mod creep;
pub mod diagnosis;
pub mod effects;
pub mod energy;
pub mod frequency;
pub mod history;
pub mod html;
pub mod inspection;
pub mod models;
pub mod next;
pub mod notebook;
pub mod page;
pub mod pest;
pub mod prediction;
pub mod profiles;
pub mod rig_drawing;
pub mod rig_plan;
pub mod sensitivity;
pub mod svg;
pub mod temperature;
pub mod text;
pub mod valve;
pub mod view;

use crate::diagnose::Diagnosis;
use crate::fit::outcome::fit::Fit;
use crate::fit::validate::predict::Prediction;
use crate::model::effects::Chosen;
use crate::model::energy::Energy;
use crate::report::advice::Advice;
use crate::rig::Rig;

/// One model in the story of a calibration.
#[derive(Debug, Clone)]
pub struct Stage<'a> {
    /// What a reader calls it: `base model`, `+ viscoelastic-wall`.
    pub title: String,
    /// The calibrated model.
    pub fit: &'a Fit,
}

impl<'a> Stage<'a> {
    /// A fit under the name of its effects.
    pub fn of(fit: &'a Fit) -> Self {
        Stage { title: title(&fit.effects), fit }
    }
}

/// What a report calls the model with these effects: `base model`, `+ leak + unsteady-friction`.
pub fn title(effects: &[Chosen]) -> String {
    match effects {
        [] => "base model".to_owned(),
        _ => format!("+ {}", effects.iter().map(Chosen::label).collect::<Vec<_>>().join(" + ")),
    }
}

/// The title of a page on recordings of a rig: `mine.mcap on hdpe-creep`. A rig that is called nothing but rig says no
/// more than its recordings.
pub fn page_title(files: &[&str], rig: &Rig) -> String {
    let files = files.join(", ");
    if rig.name.eq_ignore_ascii_case("rig") { files } else { format!("{files} on {}", rig.name) }
}

/// A curve from elsewhere, drawn over the measurement of one sensor: a digitised figure, another program's result.
#[derive(Debug, Clone, PartialEq)]
pub struct Overlay {
    /// Name of the sensor it belongs to; it is drawn in every run of that sensor.
    pub sensor: String,
    /// Its name in the legend.
    pub label: String,
    /// Times after the start of the closure, s; same length as `head_m`.
    pub time_s: Vec<f64>,
    /// Heads, m.
    pub head_m: Vec<f64>,
}

/// What a page is about.
#[derive(Debug, Clone)]
pub struct Page<'a> {
    /// Heading of the page.
    pub title: String,
    /// The rig the runs were made on.
    pub rig: &'a Rig,
    /// The models in the order in which they were tried; the last one is the result.
    pub stages: Vec<Stage<'a>>,
    /// Curves from elsewhere.
    pub overlays: Vec<Overlay>,
    /// Warnings about the result.
    pub warnings: &'a [String],
    /// The diagnoses that led from stage to stage, the first one first; none on the page of a calibration.
    pub diagnoses: &'a [Diagnosis],
    /// The last stage predicts: its samples after a time were not seen by any fit.
    pub prediction: Option<&'a Prediction>,
    /// Where the energy of the last stage's first run went, if that is known.
    pub energy: Option<Energy>,
    /// Temperature of the water in each run, °C, by its file; that of the rig where it is not among them.
    pub temperatures_degc: Vec<(String, f64)>,
    /// What to do next.
    pub advice: Option<Advice>,
}

impl<'a> Page<'a> {
    /// An empty page about a rig.
    pub fn of(rig: &'a Rig) -> Self {
        Page {
            title: String::new(),
            rig,
            stages: Vec::new(),
            overlays: Vec::new(),
            warnings: &[],
            diagnoses: &[],
            prediction: None,
            energy: None,
            temperatures_degc: Vec::new(),
            advice: None,
        }
    }

    /// Temperature of the water in a run, °C.
    pub(crate) fn temperature_degc(&self, file: &str) -> f64 {
        let known = self.temperatures_degc.iter().find(|(name, _)| name == file).map(|(_, degc)| *degc);
        known.filter(|degc| degc.is_finite()).unwrap_or(self.rig.fluid.temperature_degc)
    }
}
