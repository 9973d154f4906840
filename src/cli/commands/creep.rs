//! `surgescope creep`: Kelvin-Voigt elements from creep tests of the pipe's material.

use std::path::{Path, PathBuf};

use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say_text, tell};
use crate::creep::file::{CreepFile, HEADING};
use crate::creep::fit::fit;
use crate::creep::read::{has_strain, read};
use crate::creep::{CreepError, CreepTest};
use crate::report::creep::html::html;
use crate::report::creep::text::{document, text};
use crate::shown::Shown as _;
use crate::storage::{disk, output};

/// Fit Kelvin-Voigt elements to creep tests of the pipe's material.
///
/// A creep test is strain or compliance against time under a constant load.
/// A file has a header line, a column of times after the load was applied (time_s, time_min or time_h) and one of
/// compliance (compliance_per_GPa, _per_MPa, _per_Pa) or strain (strain, strain_percent, strain_microstrain;
/// with --stress-MPa). Several files at one temperature are repeats; tests at several temperatures are fitted together
/// with shifted times.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The tests.
    #[arg(required = true, value_name = "CSV")]
    tests: Vec<PathBuf>,
    /// Constant stress of tests that give strains.
    #[arg(long = "stress-MPa", value_name = "S", value_parser = crate::cli::args::values::positive, allow_negative_numbers = true)]
    stress_mpa: Option<f64>,
    /// Temperatures of the tests in their order, such as 15,25,35.
    #[arg(long = "temperature-degC", value_name = "T,T", value_delimiter = ',', value_parser = celsius,
          allow_negative_numbers = true)]
    temperature_degc: Vec<f64>,
    /// Reference temperature of the elements [default: that of the first test].
    #[arg(long = "reference-degC", value_name = "T", value_parser = celsius, requires = "temperature_degc",
          allow_negative_numbers = true)]
    reference_degc: Option<f64>,
    /// Number of Kelvin-Voigt elements [default: chosen by evidence].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(0..=12))]
    elements: Option<u8>,
    /// Write a page with plots of the fit; replaces an older page of that name, and no other file.
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
    /// Save the result for `calibrate --creep` and `diagnose --creep`; replaces an older result of that name, and no
    /// other file.
    #[arg(short, long, value_name = "CREEP.toml")]
    output: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// Files that cannot be read or are no creep tests, temperatures that do not match them, a result that cannot be
/// written.
pub fn run(args: Args, json: bool) -> CommandResult {
    if let Some(path) = &args.report {
        output::check_report(path)?;
    }
    if let Some(path) = &args.output {
        output::check_result(path, HEADING)?;
    }
    let temperatures = args.temperature_degc.len();
    if temperatures > 0 && temperatures != args.tests.len() {
        return Err(CreepError::Temperatures { files: args.tests.len(), temperatures }.into());
    }
    let (mut tests, mut strains) = (Vec::new(), false);
    for (i, path) in args.tests.iter().enumerate() {
        if let Some(twin) = args.tests[..i].iter().find(|p| output::same_file(p, path)) {
            return Err(format!("{} and {} are the same test: it counts once", twin.shown(), path.shown()).into());
        }
        let (test, strain) = load(path, args.stress_mpa.map(|s| s * 1e6))?;
        strains |= strain;
        tests.push(CreepTest { temperature_degc: args.temperature_degc.get(i).copied(), ..test });
    }
    if args.stress_mpa.is_some() && !strains {
        return Err("--stress-MPa is for strains, and these files give compliances: leave it out".into());
    }
    let fitted = fit(&tests, args.reference_degc, args.elements.map(usize::from))?;
    if json {
        say_document(document(&fitted))?;
    } else {
        say_text!(text(&fitted));
    }
    if let Some(path) = &args.output {
        output::check_result(path, HEADING)?;
        output::write(path, &CreepFile::of(&fitted).text()?)?;
        tell!("result: {}", path.shown());
    }
    // last, so that a page that cannot be written costs no result
    if let Some(path) = &args.report {
        output::check_report(path)?;
        output::write(path, &html(&fitted))?;
        tell!("report: {}", path.shown());
    }
    Ok(Outcome::Done)
}

/// A temperature that a solid is tested at.
fn celsius(text: &str) -> Result<f64, String> {
    let range = -200.0..=1000.0;
    crate::cli::args::values::number(text)
        .and_then(|t| if range.contains(&t) { Ok(t) } else { Err("must be from -200 to 1000".into()) })
}

/// A test, and whether it gives strains.
fn load(path: &Path, stress_pa: Option<f64>) -> Result<(CreepTest, bool), Box<dyn std::error::Error + Send + Sync>> {
    let file = path.shown().into_owned();
    let bytes = disk::read_file(path)?;
    let text = String::from_utf8(bytes).map_err(|e| CreepError::Csv {
        file: file.clone(),
        line: Some(1 + e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|b| **b == b'\n').count()),
        problem: "is not UTF-8 text: save the table as CSV with UTF-8 encoding".into(),
    })?;
    let short = path.file_name().map_or(file.clone(), |n| n.to_string_lossy().into_owned());
    let named = |e| match e {
        CreepError::Csv { line, problem, .. } => CreepError::Csv { file: file.clone(), line, problem },
        other => other,
    };
    Ok((read(&short, &text, stress_pa).map_err(named)?, has_strain(&text)))
}
