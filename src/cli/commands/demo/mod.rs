//! `surgescope demo`: the whole story, on a recording that ships with the project or with another effect hidden in a
//! simulated test.

mod hidden;

use std::io::IsTerminal;
use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::args::recordings;
use crate::cli::commands::demo::hidden::Hidden;
use crate::cli::commands::open;
use crate::cli::console::advice::Again;
use crate::cli::console::ask::agreed;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::page::write_page;
use crate::cli::console::print::{say, say_text, tell};
use crate::cli::console::progress::shown;
use crate::diagnose::Diagnosis;
use crate::fit::outcome::fit::Fit;
use crate::model::effects::CATALOGUE;
use crate::report::advice::quoted;
use crate::report::calibration::text as table;
use crate::report::diagnosis::text as diagnosis;
use crate::report::inspection::text::table as inspection;
use crate::report::view::summary;
use crate::report::{Page, Stage, title};
use crate::results::fit_record::now;
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::storage::output::{same_file, write};
use crate::study::{Study, models};

/// Record a simulated test, fit it, and add what is missing: the whole loop.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for recording, rig, models and report; created if missing. Nothing in it is overwritten.
    #[arg(short, long, value_name = "FOLDER", default_value = "surgescope-demo")]
    output: PathBuf,
    /// Hide this effect in the test; without it, a shipped test of a pipe whose wall creeps is played.
    #[arg(long, value_name = "EFFECT")]
    hidden: Option<String>,
    /// Draw the hidden effect's values and the noise, with --hidden: the same number gives the same test [default: the
    /// values where a fit starts].
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// List the effects that can be hidden.
    #[arg(long, conflicts_with = "hidden")]
    list: bool,
    /// Play the test this many times faster than it was recorded.
    #[arg(long, value_name = "FACTOR", default_value_t = 5.0, value_parser = crate::cli::args::values::positive, allow_negative_numbers = true)]
    speed: f64,
}

/// A recording of an HDPE pipe made by a simulator that shares nothing with this program; see recordings/README.md.
#[cfg_attr(not(unix), allow(dead_code))]
const RECORDING: &[u8] = include_bytes!("../../../../recordings/hdpe-creep.mcap");
/// The rig it was made on, with its sensors wired to an acquisition device.
const RIG: &str = include_str!("../../../../rigs/demo-hdpe.toml");

/// The files that a demonstration leaves.
struct Files {
    recording: PathBuf,
    rig: PathBuf,
    model: PathBuf,
    report: PathBuf,
}

/// Runs it.
///
/// # Errors
/// A folder that cannot be written, an effect that does not exist.
pub fn run(args: Args, json: bool) -> CommandResult {
    if args.list {
        return list(json);
    }
    let hidden = match (&args.hidden, args.seed) {
        (Some(name), seed) => Hidden::in_a_test(name, seed)?,
        (None, None) => Hidden::shipped(),
        (None, Some(seed)) => {
            return Err(format!(
                "--seed draws the values of a hidden effect, and the test that ships has none: write `surgescope demo --hidden leak --seed {seed}`; \
                 --list names the effects"
            )
            .into());
        }
    };
    std::fs::create_dir_all(&args.output)
        .map_err(|e| format!("cannot make the folder {}: {e}", args.output.shown()))?;
    let rig = Rig::from_toml(RIG, "rigs/demo-hdpe.toml")?;
    let files = free_names(&args.output);
    write(&files.rig, RIG)?;

    let what = if hidden.scenario.is_some() { " in which an effect is hidden" } else { "" };
    say(
        json,
        &format!(
            "1. Record. A simulated device plays a test on rig '{}'{what}, {} times faster than real time.\n",
            rig.name, args.speed
        ),
    )?;
    let outcome = record(&rig, &hidden, &files.recording, &args)?;

    let mut study = recordings::open(std::slice::from_ref(&files.recording), None)?;
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
            "\n3. Calibrate the base model: elastic pipe, steady friction.\n{}",
            summary::verdict(std::slice::from_ref(&base_stage))
        ),
    )?;

    let found = shown(&mut study, "", |study| study.diagnose(&base))?;
    say(json, &format!("\n4. Diagnose. Which effect is missing?\n{}", diagnosis::text(&found)))?;

    let mut kept = models::about(&files.model, std::slice::from_ref(&files.recording), None)?;
    kept.append(&base, "calibrated", None, now());
    let mut stages = vec![base_stage];
    if let Some(full) = found.answer() {
        kept.append(full, &found.reason(), Some(found.answer_evidence()), now());
        stages.push(Stage { title: title(&full.effects), fit: full });
        let added = format!(
            "\n5. Add '{}': the model is fitted with it.\n{}",
            found.answer_label(),
            summary::verdict(&stages) + "\n" + &table::parameters(full)
        );
        say(json, &added)?;
    }
    models::save(&mut kept, &files.model)?;
    let again = Again::of(std::slice::from_ref(&files.recording), None, &[], &[]);
    write_page(
        &files.report,
        &study,
        Page { stages, diagnoses: std::slice::from_ref(&found), ..Page::of(&rig) },
        &again,
    )?;
    if json {
        say_document(document(&study, &files, &hidden, &base, &found))?;
    } else {
        say!("{}\n{}", farewell(&files), hidden.text(&found));
        if std::io::stdin().is_terminal() && std::io::stdout().is_terminal() && agreed("\nOpen it in the workbench?")? {
            return open::run(open::Args::of(&files.model), json);
        }
    }
    Ok(outcome)
}

/// How to go on.
fn farewell(files: &Files) -> String {
    let program = program();
    let [recording, rig, model, report] =
        [&files.recording, &files.rig, &files.model, &files.report].map(|path| quoted(&path.shown()));
    format!(
        "\n6. Look. Open {report} in a browser: measurement, models, residuals, candidates, parameters.\n   The models are in \
         {model}, the rig is in {rig}: both are yours to edit.\n   Next:\n     {program} open {model}\n     {program} model {model}\n     {program} diagnose \
         {recording} --apply {model}\n     {program} demo --list\n   and your own test: `{program} rig new`, then `import` or `record` (see \
         `{program} help`).\n"
    )
}

/// The effects that can be hidden.
fn list(json: bool) -> CommandResult {
    if json {
        let effects: Vec<_> = CATALOGUE.iter().map(|e| json!({ "effect": e.name(), "summary": e.summary() })).collect();
        say_document(json!({ "effects": effects }))?;
    } else {
        for effect in CATALOGUE {
            say!("{:20} {}", effect.name(), effect.summary());
        }
    }
    Ok(Outcome::Done)
}

/// How this program is called from where the user stands: by its name where the PATH leads to it, otherwise by its
/// path.
fn program() -> String {
    // Within another program, such as Python, it is called by its name.
    let own = std::env::current_exe().ok().filter(|own| own.file_stem().is_some_and(|name| name == "surgescope"));
    let Some(own) = own else { return "surgescope".to_owned() };
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
    quoted(&inside.unwrap_or(own).shown())
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

/// The first names, `demo.mcap` and others of that stem or of `demo-2`, of which none is taken.
fn free_names(folder: &Path) -> Files {
    let mut number = 1;
    loop {
        let stem = if number == 1 { "demo".to_owned() } else { format!("demo-{number}") };
        let named = |end: &str| folder.join(format!("{stem}.{end}"));
        let files = Files {
            recording: named("mcap"),
            rig: named("rig.toml"),
            model: named("model.toml"),
            report: named("html"),
        };
        if [&files.recording, &files.rig, &files.model, &files.report].iter().all(|path| !path.exists()) {
            return files;
        }
        number += 1;
    }
}

/// Plays the shipped recording, or a simulated test, through the wire protocol and records it as from a real port.
#[cfg(unix)]
fn record(rig: &Rig, hidden: &Hidden, output: &Path, args: &Args) -> CommandResult {
    use crate::cli::console::live::Reporter;
    use crate::cli::console::stop::STOP;
    use crate::record::devices::simulated::Faults;
    use crate::record::session::live_test::{Options, live_devices};
    use crate::simulate::playback::{USUAL_SEED, of_recording, of_scenario};
    use crate::simulate::through_ports::record_playbacks;

    let shipped = shipped()?;
    let mut played = Vec::new();
    for device in live_devices(rig, &[])? {
        let playback = match &hidden.scenario {
            Some(scenario) => of_scenario(scenario, &device, &timing(scenario), args.seed.unwrap_or(USUAL_SEED))?,
            None => of_recording(&shipped, rig, &device)?,
        };
        played.push((device, playback));
    }
    let note = match &hidden.scenario {
        Some(_) => "a simulated test with a hidden effect",
        None => "recordings/hdpe-creep.mcap played through a simulated device",
    };
    let options = Options { notes: vec![("demo".to_owned(), note.to_owned())], ..Options::new(output) };
    let reporter = Reporter::open();
    let recorded =
        record_playbacks(rig, played, (args.speed, Faults::default()), &options, &STOP, &mut |now| reporter.show(now));
    reporter.close();
    let recorded = recorded?;
    tell!("   {}: {:.1} s from the wire", output.shown(), recorded.duration_s);
    Ok(if recorded.data_lost { Outcome::DataLost } else { Outcome::Done })
}

/// Without pseudo-terminals the test itself is used.
#[cfg(not(unix))]
fn record(rig: &Rig, hidden: &Hidden, output: &Path, args: &Args) -> CommandResult {
    let recording = match &hidden.scenario {
        Some(scenario) => {
            let seed = args.seed.unwrap_or(crate::simulate::playback::USUAL_SEED);
            let instruments = crate::simulate::synthetic::Instruments { timing: timing(scenario), noise_m: None, seed };
            crate::simulate::synthetic::recording_of(
                scenario,
                &scenario.simulate(instruments.timing.after_s)?,
                &instruments,
            )?
        }
        None => shipped()?.on_rig(rig.clone())?,
    };
    crate::storage::write(output, &recording)?;
    Ok(Outcome::Done)
}

/// How a simulated test is played: half the periods of the shipped test, for a reader waits while it is diagnosed.
fn timing(scenario: &crate::simulate::scenario::Scenario) -> crate::simulate::playback::Timing {
    crate::simulate::playback::Timing { rate_hz: 500.0, lead_s: 1.0, after_s: 4.0 * scenario.period_s() }
}

fn shipped() -> Result<crate::recording::Recording, Box<dyn std::error::Error + Send + Sync>> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("hdpe-creep.mcap");
    std::fs::write(&path, RECORDING)?;
    Ok(crate::storage::read(&path)?)
}

fn document(study: &Study, files: &Files, hidden: &Hidden, base: &Fit, found: &Diagnosis) -> serde_json::Value {
    let stage = |fit: &Fit| {
        let all = summary::overall(fit);
        json!({ "effects": fit.labels(), "rmse_m": all.rmse_m, "noise_m": all.noise_m, "seconds": fit.seconds })
    };
    json!({
        "recording": files.recording,
        "rig": files.rig,
        "model": files.model,
        "report": files.report,
        "duration_s": study.recordings()[0].recording.series.iter().filter_map(|s| s.time_s.last()).fold(0.0f64, |a, &b| a.max(b)),
        "hidden": hidden.effect,
        "truth": hidden.json(found),
        "verdict": found.verdict.name(),
        "answer": found.answer_label(),
        "probability": found.probability,
        "stages": std::iter::once(base).chain(found.answer()).map(stage).collect::<Vec<_>>(),
    })
}
