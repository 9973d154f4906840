//! `surgescope valve`: how the valve closed, read back from the record.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::json;

use super::{CommandResult, Outcome, calibrate, load};
use crate::fit::calibrate::Options;
use crate::fit::valve_curve::{ValveClosure, closure_of, valve_sensor};
use crate::model::effects::{Chosen, parse_list};

/// How the valve closed, read back from the head measured before it: opening against time, and the laws nearest to it.
///
/// A model is calibrated first; then the measured head takes the place of its valve, and what arrives there tells the flow.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recordings, all of one rig.
    #[arg(required = true, value_name = "MCAP")]
    recordings: Vec<PathBuf>,
    /// Effects of the model.
    #[arg(long, value_name = "A,B", default_value = "none", value_parser = parse_list)]
    effects: ::std::vec::Vec<Chosen>,
    /// A rig to read them with, instead of the one that is stored in them.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
}

/// Rows of the table of one run.
const ROWS: usize = 20;

/// Runs it.
///
/// # Errors
/// As `calibrate`; a rig without a pressure sensor at the valve.
pub fn run(args: Args, json: bool) -> CommandResult {
    let loaded = load::load(&args.recordings, args.rig.as_deref())?;
    let rig = loaded[0].recording.rig.clone();
    let runs = load::runs(&loaded);
    for run in &runs {
        valve_sensor(&rig, run)?;
    }
    let fit = calibrate::timed(&rig, &runs, &args.effects, &Options::default())?;
    let closures: Vec<ValveClosure> =
        (0..runs.len()).map(|r| closure_of(&rig, &runs, &fit, r)).collect::<Result<_, _>>()?;
    if json {
        let document = json!({ "effects": fit.labels(), "runs": closures.iter().map(document).collect::<Vec<_>>() });
        super::say!("{document:#}");
    } else {
        super::say_text!(closures.iter().map(text).collect::<Vec<_>>().join("\n"));
    }
    Ok(Outcome::Done)
}

fn document(closure: &ValveClosure) -> serde_json::Value {
    let law = closure.two_stage;
    json!({
        "file": closure.file,
        "sensor": closure.sensor,
        "fitted_closing_time_s": closure.fitted_closing_s,
        "effective_closing_time_s": closure.effective_closing_s,
        "two_stage": { "inflection_s": law.inflection_s, "inflection_opening": law.inflection_opening,
                       "closing_time_s": law.closing_s, "rms_of_opening": law.rms },
        "time_s": closure.curve.time_s,
        "velocity_m_s": closure.curve.velocity_m_s,
        "opening": closure.curve.opening,
    })
}

fn text(closure: &ValveClosure) -> String {
    let law = closure.two_stage;
    let mut out = format!("{}, by {}:\n", closure.file, closure.sensor);
    let _ = writeln!(out, "  closing time of the fitted model   {:.4} s", closure.fitted_closing_s);
    if let Some(effective_s) = closure.effective_closing_s {
        let _ = writeln!(out, "  effective (from 0.9 to 0.1, times 1/0.8)  {effective_s:.4} s");
    }
    let _ = writeln!(
        out,
        "  nearest two stages   to {:.3} of the opening in {:.4} s, closed at {:.4} s; {:.3} of the opening off, rms",
        law.inflection_opening, law.inflection_s, law.closing_s, law.rms
    );
    let _ = writeln!(out, "\n   time, s  velocity, m/s  opening  two stages");
    let points = closure.curve.time_s.len();
    for i in (0..points).step_by(points.div_ceil(ROWS).max(1)) {
        let (time_s, opening) = (closure.curve.time_s[i], closure.curve.opening[i]);
        let bar = "█".repeat((30.0 * opening.clamp(0.0, 1.2)).round() as usize);
        let _ = writeln!(
            out,
            "{time_s:>10.4} {:>14.4} {opening:>8.3} {:>11.3}  {bar}",
            closure.curve.velocity_m_s[i],
            law.opening(time_s)
        );
    }
    out
}
