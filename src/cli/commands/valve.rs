//! `surgescope valve`: how the valve closed, read back from the record.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::args::creep_prior::WALL;
use crate::cli::args::recordings;
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say_text, tell, tell_warning};
use crate::cli::console::progress::shown;
use crate::extent::ends;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::problem::valve_curve::valve_sensor;
use crate::model::effects::{Chosen, parse_list};
use crate::report::text::number::{fixed, grouped};
use crate::report::valve::json::document;
use crate::report::valve::svg::chart;
use crate::report::valve::text::text;
use crate::shown::Shown as _;
use crate::storage::output;
use crate::valve::curve::{ValveClosure, ValveLawChoice, choose_valve_law, closure_of};

/// Reconstruct how the valve closed from the head upstream of it.
///
/// First, a model is calibrated with a valve that closes linearly and with one that closes in two stages (`valve-law`),
/// if the record supports that. Then the measured head replaces the valve, and the waves that arrive there give the
/// flow and the opening.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Recordings of one rig.
    #[arg(required = true, value_name = "MCAP")]
    recordings: Vec<PathBuf>,
    /// Effects of the pipe; a valve-law among them also decides the valve's law.
    #[arg(long, value_name = "A,B", default_value = "none", value_parser = parse_list)]
    effects: ::std::vec::Vec<Chosen>,
    /// Read the recordings with this rig instead of the stored one.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// Draw the curve of one recording, its two stages, and its change with wave speed and creep.
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// As `calibrate`; a rig without a pressure sensor at the valve.
pub fn run(args: Args, json: bool) -> CommandResult {
    if args.svg.is_some() && args.recordings.len() > 1 {
        return Err("--svg draws the valve of one recording: name one".into());
    }
    if let Some(path) = &args.svg {
        output::check_picture(path)?;
    }
    let mut study = recordings::open(&args.recordings, args.rig.as_deref())?;
    for run in study.runs() {
        valve_sensor(study.rig(), run)?;
    }
    let ValveLawChoice { fit, evidence, two_stages } = shown(&mut study, "", |study| {
        choose_valve_law(study.rig(), &args.effects, |effects| study.calibrate(effects).run())
    })?;
    let (rig, runs) = (study.rig(), study.runs());
    if let Some(evidence) = evidence {
        tell!(
            "the model's valve closes {}: the ln odds of two stages against one are {} (from {STRONG_EVIDENCE:.0} they are strong){}",
            if two_stages { "in two stages" } else { "linearly" },
            grouped(evidence),
            if !two_stages && evidence > STRONG_EVIDENCE {
                ", but leave most of the error, which comes from the pipe"
            } else {
                ""
            },
        );
    }
    let closures: Vec<ValveClosure> =
        (0..runs.len()).map(|r| closure_of(rig, runs, &fit, r)).collect::<Result<_, _>>()?;
    let creep_missing = rig.constraint_in_words().is_some() && !fit.effects.iter().any(|c| c.effect.name() == WALL);
    for closure in &closures {
        if let Some(warning) = no_valve(closure, creep_missing) {
            tell_warning!("{warning}");
        }
    }
    if json {
        let document = json!({ "effects": fit.labels(), "runs": closures.iter().map(document).collect::<Vec<_>>() });
        say_document(document)?;
    } else {
        say_text!(closures.iter().map(text).collect::<Vec<_>>().join("\n"));
    }
    if let (Some(path), Some(closure)) = (&args.svg, closures.first()) {
        output::check_picture(path)?;
        output::write(path, &chart(closure).to_svg(900.0, 480.0))?;
        tell!("chart: {}", path.shown());
    }
    Ok(Outcome::Done)
}

/// Openings that no valve has, beyond what noise does.
const OPENINGS: std::ops::RangeInclusive<f64> = -0.05..=1.05;

/// What to do about a curve that is no valve's.
fn no_valve(closure: &ValveClosure, creep_missing: bool) -> Option<String> {
    let known = closure.curve.opening.iter().copied().filter(|o| o.is_finite());
    let (least, most) = ends(known);
    (!(OPENINGS.contains(&least) && OPENINGS.contains(&most))).then(|| {
        let what = if creep_missing { "add --effects viscoelastic-wall" } else { "`surgescope diagnose` finds what" };
        format!(
            "{}: openings from {} to {} are impossible: the curve compensates for something that the model of the pipe lacks; {what}",
            closure.file,
            fixed(least, 2),
            fixed(most, 2)
        )
    })
}
