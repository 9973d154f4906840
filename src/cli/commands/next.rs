//! `surgescope next`: the test that tells the answers left standing apart.

use std::path::PathBuf;

use crate::cli::args::recordings;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell};
use crate::cli::console::progress::{refit, shown};
use crate::report::next::html::html;
use crate::report::next::text::{Narrowing, contest, document, only, settings, settings_file, title};
use crate::shown::Shown as _;
use crate::storage::output;
use crate::study::models;
use crate::study::next::{Contest, least_known};

/// Find the test that tells apart what the recordings cannot.
///
/// The model in force is diagnosed. For each two answers left standing, every test that the rig can do is simulated
/// under both: another flow, closing time, static head or temperature, a sensor more, the suspected cause put right.
/// The tests come with the odds that each is expected to bring.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The model file that `calibrate --save` or `diagnose --apply` wrote.
    #[arg(value_name = "MODEL.toml")]
    file: PathBuf,
    /// Compare these two effects, without a diagnosis; `none` is the model as it is.
    #[arg(long, value_name = "A,B", value_delimiter = ',', num_args = 1, conflicts_with = "narrow")]
    between: Vec<String>,
    /// Find the test that narrows this parameter most instead, such as wave_speed_m_s.
    #[arg(long = "for", value_name = "NAME")]
    narrow: Option<String>,
    /// Write the settings of the best test.
    #[arg(long, value_name = "TEST.toml")]
    save: Option<PathBuf>,
    /// Replace an older file of settings.
    #[arg(long)]
    overwrite: bool,
    /// Write a page with what each sensor would show, or with the tests that narrow the parameter; replaces an older
    /// page of that name, and no other file.
    #[arg(long, value_name = "HTML")]
    report: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// A file or a recording that cannot be read, an effect or a parameter that does not exist, a file that cannot be
/// written.
pub fn run(args: Args, json: bool) -> CommandResult {
    if let Some(path) = &args.report {
        output::check_report(path)?;
    }
    if let Some(path) = &args.save {
        output::check_new(path, args.overwrite)?;
    }
    if !args.between.is_empty() && args.between.len() != 2 {
        return Err("--between takes two effects, such as leak,blockage".into());
    }
    let mut at = models::open(&args.file)?;
    recordings::warn_of(&at.study);
    let start = refit(&mut at, "current model, ")?;
    let mut asked = args.narrow.clone();
    let mut contests: Vec<Contest> = Vec::new();
    let (mut fit, mut alone) = (start.clone(), None);
    if asked.is_none() {
        let (standing, better) = shown(&mut at.study, "", |study| {
            if let [one, other] = args.between.as_slice() {
                return Ok::<_, crate::Error>((vec![study.answer(&start, one)?, study.answer(&start, other)?], None));
            }
            let found = study.diagnose(&start)?;
            Ok((study.standing(&found), found.answer().cloned()))
        })?;
        contests = shown(&mut at.study, "", |study| study.contests(&start, &standing))?;
        if let [one] = standing.as_slice() {
            alone = Some(only(one));
        }
        if contests.is_empty() {
            fit = better.unwrap_or(fit);
            asked = least_known(&fit).map(|p| p.name.clone());
        }
    }
    let narrowed = asked
        .as_deref()
        .map(|name| {
            let tests = shown(&mut at.study, "", |study| study.narrowing(&fit, name))?;
            Ok::<_, crate::Error>(Narrowing { parameter: name.to_owned(), unit: fit.parameter(name)?.unit, tests })
        })
        .transpose()?;
    if json {
        say_document(document(at.study.rig(), &contests, narrowed.as_ref()))?;
    } else {
        if let Some(alone) = &alone {
            say!("{alone}");
        }
        for of in &contests {
            say_text!(contest(of));
        }
        if let Some(narrowed) = &narrowed {
            say_text!(narrowed.text());
        }
    }
    let told =
        contests.iter().find_map(|c| Some((title(&c.between), c.tests.first().filter(|t| t.repeats.is_some())?)));
    let best = told.map(|(why, test)| (why, test.instruction.clone(), test.change, test.run));
    let best = best.or_else(|| {
        let Narrowing { parameter, tests, .. } = narrowed.as_ref()?;
        tests.first().map(|t| (format!("narrows {parameter}"), t.instruction.clone(), t.change, t.run))
    });
    if let (Some(path), Some((why, instruction, change, run))) = (&args.save, &best) {
        let settings = settings(at.study.rig(), change, run);
        output::write_new(path, &settings_file(why, instruction, &settings)?, args.overwrite)?;
        tell!("settings: {}", path.shown());
    }
    if let Some(path) = &args.report {
        output::write(path, &html(&at.study.rig().name, alone.as_deref(), &contests, narrowed.as_ref()))?;
        tell!("report: {}", path.shown());
    }
    Ok(if best.is_some() { Outcome::Done } else { Outcome::No })
}
