//! `surgescope rig`: says where a rig, or a recording made on it, contradicts itself.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use crate::cli::args::values::positive;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::say_text;
use crate::cli::console::progress::busy;
use crate::recording::Recording;
use crate::rig::check::{Finding, Level, check};
use crate::rig::{Rig, SteadyState};
use crate::signal::check::check_recording;
use crate::signal::faults::{SensorFault, sensor_faults};
use crate::signal::window::used;
use crate::storage as log;
use crate::storage::ImportOptions;
use crate::storage::import::{SourceOptions, import_file};

/// Find contradictions in a rig file, or between a rig file and a recording.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The rig file (TOML).
    rig: PathBuf,
    /// A recording (MCAP) or a time series, as `import --yes` reads it, made on it.
    recording: Option<PathBuf>,
    /// A steady flow to compare with the rig, m3/h (as `[[steady]]` in the rig file).
    #[arg(long, value_name = "M3_H", value_parser = positive, allow_negative_numbers = true)]
    flow: Option<f64>,
    /// The supply's head at that flow, m.
    #[arg(long, value_name = "M", value_parser = positive, allow_negative_numbers = true, requires = "flow")]
    supply_head: Option<f64>,
    /// The Reynolds number reported for that flow.
    #[arg(long, value_name = "RE", value_parser = positive, allow_negative_numbers = true, requires = "flow")]
    reynolds: Option<f64>,
}

/// Runs the command; the answer is 'no' where there is a contradiction.
pub fn run(args: &Args, json: bool) -> CommandResult {
    let mut rig = Rig::load(&args.rig)?;
    if let Some(flow_m3_h) = args.flow {
        rig.steady.push(SteadyState {
            name: format!("{flow_m3_h} m3/h"),
            flow_m3_s: flow_m3_h / 3600.0,
            supply_head_m: args.supply_head,
            temperature_degc: None,
            reynolds_number: args.reynolds,
            wave_speed_m_s: None,
        });
    }
    let mut faults = Vec::new();
    let mut findings = check(&rig);
    if let Some(path) = &args.recording {
        let (recording, _) = used(busy(path, || read(path, &rig))?);
        findings.extend(check_recording(&rig, &recording));
        // What does not fit this rig is a finding of the check above.
        faults = recording.on_rig(rig.clone()).map(|r| sensor_faults(&r)).unwrap_or_default();
        findings.extend(faults.iter().map(|f| {
            let level = if f.forbids_a_fit() { Level::Contradiction } else { Level::Warning };
            Finding::new(level, format!("sensor '{}' is {}", f.sensor, f.fault.words()), f.says.clone(), &[])
        }));
    }
    let worst = findings.iter().map(|f| f.level).max().unwrap_or(Level::Fine);
    if json {
        say_document(document(&args.rig, args.recording.as_deref(), worst, &findings, &faults))?;
    } else {
        say_text!(table(&findings));
    }
    Ok(if worst == Level::Contradiction { Outcome::No } else { Outcome::Done })
}

fn read(path: &Path, rig: &Rig) -> Result<Recording, log::LogError> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("mcap")) {
        return log::read(path);
    }
    let guesses = SourceOptions { guess: true, ..SourceOptions::default() };
    import_file(path, rig, &ImportOptions::default(), &guesses, true).map(|imported| imported.recording)
}

fn document(rig: &Path, recording: Option<&Path>, worst: Level, findings: &[Finding], faults: &[SensorFault]) -> Value {
    let finding = |f: &Finding| {
        let numbers: Map<String, Value> = f.numbers.iter().map(|(name, v)| ((*name).to_owned(), json!(v))).collect();
        json!({ "level": f.level.word(), "subject": f.subject, "message": f.message, "numbers": numbers })
    };
    json!({
        "rig": rig.display().to_string(),
        "recording": recording.map(|p| p.display().to_string()),
        "verdict": worst.word(),
        "sensor_faults": faults,
        "findings": findings.iter().map(finding).collect::<Vec<_>>(),
    })
}

/// The worst first, each with its level and its numbers; then how many there are of each.
pub(super) fn table(findings: &[Finding]) -> String {
    let mut text = String::new();
    for level in [Level::Contradiction, Level::Warning, Level::Fine] {
        for finding in findings.iter().filter(|f| f.level == level) {
            text += &format!("{:13}  {}: {}\n", level.word(), finding.subject, finding.message);
        }
    }
    let count = |level| findings.iter().filter(|f| f.level == level).count();
    let (contradictions, warnings, fine) = (count(Level::Contradiction), count(Level::Warning), count(Level::Fine));
    text + &format!("\ncontradictions: {contradictions}, warnings: {warnings}, fine: {fine}\n")
}
