//! `surgescope demo`: the whole story on a recording that ships with the project.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::args::recordings;
use crate::cli::console::advice::Again;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::page::write_page;
use crate::cli::console::print::{say, say_text, tell};
use crate::cli::console::progress::shown;
use crate::fit::outcome::fit::Fit;
use crate::report::calibration::text as table;
use crate::report::inspection::text::table as inspection;
use crate::report::view::{failure, summary};
use crate::report::{Page, Stage};
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage::output::same_file;
use crate::study::Study;

/// Record a simulated test, fit it, and add what is missing: the whole loop.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the recording and the report; created if missing. Nothing in it is overwritten.
    #[arg(short, long, value_name = "FOLDER", default_value = "surgescope-demo")]
    output: PathBuf,
    /// Play the test this many times faster than it was recorded.
    #[arg(long, value_name = "FACTOR", default_value_t = 5.0, value_parser = crate::cli::args::values::positive, allow_negative_numbers = true)]
    speed: f64,
}

/// A recording of an HDPE pipe made by a simulator that shares nothing with this program; see recordings/README.md.
const RECORDING: &[u8] = include_bytes!("../../../recordings/hdpe-creep.mcap");
/// The rig it was made on, with its sensors wired to an acquisition device.
const RIG: &str = include_str!("../../../rigs/demo-hdpe.toml");
const EFFECT: &str = "viscoelastic-wall";

/// Runs it.
///
/// # Errors
/// A folder that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    std::fs::create_dir_all(&args.output)
        .map_err(|e| format!("cannot make the folder {}: {e}", args.output.shown()))?;
    let rig = Rig::from_toml(RIG, "rigs/demo-hdpe.toml")?;
    let (recording, report) = free_names(&args.output);

    say(
        json,
        &format!(
            "1. Record. A simulated device plays a test on rig '{}', {} times faster than real time.\n",
            rig.name, args.speed
        ),
    )?;
    let outcome = record(&rig, &recording, args.speed)?;

    let mut study = recordings::open(std::slice::from_ref(&recording), None)?;
    say(
        json,
        &format!(
            "\n2. Inspect. What the recording shows without a model.\n{}",
            inspection(&study.recordings()[0].recording, &study.recordings()[0].features)
        ),
    )?;

    let base = shown(&mut study, "", |study| study.calibrate("none").run())?;
    let base_stage = Stage::of(&base);
    say(
        json,
        &format!(
            "\n3. Calibrate the base model: elastic pipe, steady friction.\n{}\nWhere it fails:\n{}",
            summary::verdict(std::slice::from_ref(&base_stage)),
            failure::describe(&base)
        ),
    )?;

    let full = shown(&mut study, "", |study| study.calibrate(EFFECT).run())?;
    let stages = vec![base_stage, Stage { title: format!("+ {EFFECT}"), fit: &full }];
    say(json, &format!("\n4. Add '{EFFECT}' and calibrate again.\n{}", table::calibration(&stages)))?;

    let again = Again::of(std::slice::from_ref(&recording), None, &[], &[]);
    write_page(&report, &study, Page { stages, ..Page::of(&rig) }, &again)?;
    if json {
        say!("{:#}", document(&study, &recording, &report, &base, &full));
    } else {
        let (program, recording) = (program(), quoted(&recording));
        say!(
            "\n5. Look. Open {} in a browser: measurement, both models, residuals, parameters.\n   Next:\n     {program} inspect \
             {recording}\n     {program} calibrate {recording} --effects {EFFECT}:2\n   and your own test with `import` or `record` (see \
             `{program} help`).",
            report.shown(),
        );
    }
    Ok(outcome)
}

/// How this program is called from where the user stands: by its name where the PATH leads to it, otherwise by its path.
fn program() -> String {
    let Ok(own) = std::env::current_exe() else { return "surgescope".to_owned() };
    let name = own.file_name().unwrap_or(own.as_os_str());
    let path = std::env::var_os("PATH").unwrap_or_default();
    if std::env::split_paths(&path)
        .find(|folder| folder.join(name).is_file())
        .is_some_and(|f| same_file(&f.join(name), &own))
    {
        return name.to_string_lossy().into_owned();
    }
    let here = std::env::current_dir().ok().and_then(|here| here.canonicalize().ok());
    let own = own.canonicalize().unwrap_or(own);
    let inside = here.and_then(|here| own.strip_prefix(here).ok().map(|rest| Path::new(".").join(rest)));
    quoted(&inside.unwrap_or(own))
}

/// A path as a shell takes it.
fn quoted(path: &Path) -> String {
    let text = path.shown().into_owned();
    let plain = text.chars().all(|c| c.is_alphanumeric() || "/._-+:\\".contains(c));
    if plain { text } else { format!("'{}'", text.replace('\'', "'\\''")) }
}

/// The story goes to standard output; to standard error where that is kept for JSON.
fn say(json: bool, text: &str) -> std::io::Result<()> {
    if json {
        tell!("{text}");
    } else {
        say_text!(format!("{text}\n"));
    }
    Ok(())
}

/// The first pair of names, `demo.mcap` and `demo.html` or `demo-2.…`, of which neither is taken.
fn free_names(folder: &Path) -> (PathBuf, PathBuf) {
    let mut number = 1;
    loop {
        let stem = if number == 1 { "demo".to_owned() } else { format!("demo-{number}") };
        let names = (folder.join(format!("{stem}.mcap")), folder.join(format!("{stem}.html")));
        if !names.0.exists() && !names.1.exists() {
            return names;
        }
        number += 1;
    }
}

/// Plays the shipped recording through the wire protocol and records it as from a real port.
#[cfg(unix)]
fn record(rig: &Rig, output: &Path, speed: f64) -> CommandResult {
    use crate::cli::console::live::Reporter;
    use crate::cli::console::stop::STOP;
    use crate::record::devices::simulated::Faults;
    use crate::record::session::live_test::{Options, live_devices};
    use crate::simulate::through_ports::record_playbacks;

    let shipped = shipped()?;
    let mut played = Vec::new();
    for device in live_devices(rig, &[])? {
        let playback = crate::simulate::playback::of_recording(&shipped, rig, &device)?;
        played.push((device, playback));
    }
    let note = "recordings/hdpe-creep.mcap played through a simulated device";
    let options = Options { notes: vec![("demo".to_owned(), note.to_owned())], ..Options::new(output) };
    let reporter = Reporter::open();
    let recorded =
        record_playbacks(rig, played, (speed, Faults::default()), &options, &STOP, &mut |now| reporter.show(now));
    reporter.close();
    let recorded = recorded?;
    tell!("   {}: {:.1} s from the wire", output.shown(), recorded.duration_s);
    Ok(if recorded.data_lost { Outcome::DataLost } else { Outcome::Done })
}

/// Without pseudo-terminals the shipped recording itself is used.
#[cfg(not(unix))]
fn record(rig: &Rig, output: &Path, _speed: f64) -> CommandResult {
    crate::storage::write(output, &shipped()?.on_rig(rig.clone())?)?;
    Ok(Outcome::Done)
}

fn shipped() -> Result<crate::recording::Recording, Box<dyn std::error::Error + Send + Sync>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("hdpe-creep.mcap");
    std::fs::write(&path, RECORDING)?;
    Ok(crate::storage::read(&path)?)
}

fn document(study: &Study, recording: &Path, report: &Path, base: &Fit, full: &Fit) -> serde_json::Value {
    let stage = |fit: &Fit| {
        let all = summary::overall(fit);
        json!({ "effects": fit.labels(), "rmse_m": all.rmse_m, "noise_m": all.noise_m, "seconds": fit.seconds })
    };
    json!({
        "recording": recording,
        "report": report,
        "duration_s": study.recordings()[0].recording.series.iter().filter_map(|s| s.time_s.last()).fold(0.0f64, |a, &b| a.max(b)),
        "stages": [stage(base), stage(full)],
    })
}
