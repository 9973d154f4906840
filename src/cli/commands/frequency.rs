//! `surgescope frequency`: the frequency response of record and model.

use std::path::PathBuf;

use crate::cli::args::own_values::Own;
use crate::cli::args::recordings;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say_text, tell, tell_warning};
use crate::fit::data::run_data::RunData;
use crate::fit::outcome::fit::Fit;
use crate::fit::validate::frequency::{SensorResponse, Traces, response};
use crate::model::Model;
use crate::report::frequency::html::html;
use crate::report::frequency::text::{document, svg, text};
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage::output;
use crate::study::open::Loaded;

/// Show amplitude and phase of the head at the pipe's odd harmonics.
///
/// Of a recording, and of a model beside it.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording.
    #[arg(value_name = "MCAP")]
    recording: PathBuf,
    /// Compare the recording with the current model of this model file, as `predict` does.
    #[arg(long, value_name = "MODEL.toml")]
    model: Option<PathBuf>,
    #[command(flatten)]
    own: Own,
    /// Write a page with amplitude and phase at each sensor; replaces an older page of that name, and no other file.
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
    /// Write a picture of the sensor nearest to the valve; replaces an older picture of that name, and no other file.
    #[arg(long, value_name = "SVG")]
    svg: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// A recording or a model that cannot be read, or too short a recording; a page or a picture that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    if let Some(path) = &args.report {
        output::check_report(path)?;
    }
    if let Some(path) = &args.svg {
        output::check_picture(path)?;
    }
    let files = std::slice::from_ref(&args.recording);
    let (study, fit) = match &args.model {
        Some(model) => {
            let (study, known) = args.own.predicted(model, files)?;
            for warning in &known.warnings {
                tell_warning!("{warning}");
            }
            (study, Some(known.prediction.fit))
        }
        None => (recordings::open(files, args.own.rig.as_deref())?, None),
    };
    let (file, effects) = (&study.recordings()[0].file, fit.as_ref().map(Fit::labels));
    let sensors = responses(&study.recordings()[0], &study.runs()[0], fit.as_ref());
    if sensors.is_empty() {
        return Err(format!(
            "{file} holds less than three periods of the pipe after the closure: too short for a frequency response"
        )
        .into());
    }
    if json {
        say_document(document(&sensors, effects.clone()))?;
    } else {
        say_text!(text(&sensors));
    }
    if let (Some(path), Some(last)) = (&args.svg, sensors.first()) {
        output::check_picture(path)?;
        output::write(path, &svg(last))?;
        tell!("picture: {}", path.shown());
    }
    if let Some(path) = &args.report {
        let against = effects.map_or("the record alone".to_owned(), |e| match e.as_slice() {
            [] => "against the base model".to_owned(),
            some => format!("against the base model + {}", some.join(" + ")),
        });
        output::check_report(path)?;
        output::write(path, &html(&format!("Frequency response of {file}"), &against, &sensors))?;
        tell!("report: {}", path.shown());
    }
    Ok(Outcome::Done)
}

/// The record at each sensor, and the model of a `fit` beside it, the nearest to the valve first. Period and closure
/// are the record's own, so that what it shows is the same whatever the model; where the wave speed is not to be had
/// from it, the rig's.
fn responses(loaded: &Loaded, run: &RunData, fit: Option<&Fit>) -> Vec<SensorResponse> {
    let rig: &Rig = &loaded.recording.rig;
    let model = Model::new(rig, &run.conditions.water, &[]);
    let ratio = run.start.wave_speed_ratio.unwrap_or(1.0);
    let period_s = model.period_s(&model.shared.iter().map(|p| p.start * ratio).collect::<Vec<_>>());
    let closure_s = run.start.closure_s.0;
    let closing_s = loaded.features.closure.end_s.map_or(rig.valve.closing_time_s, |end| end - closure_s).max(0.0);
    let mut sensors: Vec<_> = run.sensors.iter().collect();
    sensors.sort_by(|a, b| b.sensor.position_m.total_cmp(&a.sensor.position_m));
    let found = sensors.into_iter().filter_map(|s| {
        let from = s.time_s.partition_point(|&t| t < closure_s);
        let time_s: Vec<f64> = s.time_s[from..].iter().map(|t| t - closure_s).collect();
        let model_m = fit.and_then(|fit| modelled(fit, &s.sensor.name, time_s.len()));
        let traces = Traces {
            name: &s.sensor.name,
            file: &run.file,
            time_s: &time_s,
            measured_m: &s.head_m[from..],
            model_m: model_m.as_deref(),
            noise_m: s.noise_m,
        };
        response(&traces, period_s, closing_s)
    });
    found.collect()
}

/// The model at the last `samples` of a sensor; the fit has those from its own start of the closure on, and no value
/// before.
fn modelled(fit: &Fit, sensor: &str, samples: usize) -> Option<Vec<f64>> {
    let known = &fit.runs[0].sensors.iter().find(|s| s.name == sensor)?.model_m;
    let more = known.len().saturating_sub(samples);
    let before = std::iter::repeat_n(f64::NAN, samples.saturating_sub(known.len()));
    Some(before.chain(known[more..].iter().copied()).collect())
}
