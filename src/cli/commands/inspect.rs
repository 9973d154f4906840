//! `surgescope inspect`: what a recording shows without a model.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell_warning};
use crate::cli::console::progress::busy;
use crate::report::inspection::json::document;
use crate::report::inspection::text::table;
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::signal::faults::in_words;
use crate::study::error::Error;
use crate::study::open::Loaded;

/// Show what a recording contains: heads, period, wave speed, closure, noise.
///
/// With `--json`: `file`, `temperature_degC`, `closure` {`start_s`, `start_standard_error_s`, `end_s`, `slow`,
/// `from_trigger`, `pressure_onset_s`}, `flow_m3_s`, `steady_velocity_m_s`, `period_s`, `damping_per_cycle`,
/// `wave_speed_m_s` {`joukowsky`, `crossings` {`value`, `standard_error`, `low`, `high`, `slow_closure`}, `arrival`,
/// `period`}, `reference_sensor` and `sensors` [{`name`, `position_m`, `samples`, `gaps`, `interval_s`, `noise`
/// {`white_sd_m`, `total_sd_m`, `coloured`, `lag1_autocorrelation`, `effective_fraction`, `quantum_m`,
/// `interpolated_share`, `hum`, `without_hum`, `line`}, `steady_before_m`, `steady_after_m`, `front_arrival_s`,
/// `first_peak`, `extrema` [{`cycle`, `peak`, `time_s`, `head_m`}], `damping_per_cycle`}], `doubts` (sentences on
/// contradictions), `sensor_faults` [{`sensor`, `fault`, `says`}], `notes` [{`key`, `value`}], `window` {`from_s`,
/// `to_s`, `averaged`, `recorded_s`} (what of a long recording is used, else null). Values with an uncertainty are
/// {`value`, `standard_error`}; values that the recording does not show are null.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording.
    recording: PathBuf,
    #[command(flatten)]
    ignored: crate::cli::args::ignore::Ignored,
    /// Read the recording with this rig instead of the stored one; sensors are matched by name.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// An unreadable recording, a rig that does not fit it, or a recording without a closure.
pub fn run(args: Args, json: bool) -> CommandResult {
    let mut recording = busy(&args.recording, || crate::storage::read(&args.recording))?;
    if let Some(rig) = &args.rig {
        recording = recording.on_rig(Rig::load(rig)?)?;
    }
    let recording = recording.without(&args.ignored.sensors)?;
    let loaded = match Loaded::new(args.recording.shown().into_owned(), recording) {
        Err(Error::Faulty { file, faults, source: Some(why) }) => {
            if json {
                say_document(json!({ "file": args.recording, "sensor_faults": faults, "error": why.to_string() }))?;
            }
            return Err(Box::new(Error::Faulty { file, faults, source: Some(why) }));
        }
        other => other?,
    };
    let Loaded { recording, features, faults, window, .. } = &loaded;
    if !faults.is_empty() {
        tell_warning!("{}", in_words(faults));
    }
    if json {
        let mut document = document(recording, features);
        document["file"] = json!(args.recording);
        document["sensor_faults"] = json!(faults);
        document["window"] = json!(window);
        say_document(document)?;
    } else {
        say_text!(table(recording, features));
        if let Some(window) = window {
            say!("\nnote: {}", window.in_words());
        }
    }
    Ok(Outcome::Done)
}
