//! `surgescope valve`: how the valve closed, read back from the record.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::json;

use crate::cli::args::creep_prior::WALL;
use crate::cli::args::recordings;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, say_text, tell};
use crate::cli::console::progress::shown;
use crate::fit::search::calibrate::EVIDENCE;
use crate::model::effects::{Chosen, parse_list};
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::number::{fixed, significant};
use crate::report::text::table::Table;
use crate::storage::output;
use crate::valve::curve::{Lawful, TwoStage, ValveClosure, closure_of, valve_sensor, with_its_law};
use crate::valve::shift::{LawError, Shift};

/// Reconstruct how the valve closed from the head upstream of it.
///
/// First, a model is calibrated with a valve that closes linearly and with one that closes in two stages (`valve-law`), if the record supports
/// that. Then the measured head replaces the valve, and the waves that arrive there give the flow and the opening.
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

/// Rows of the table of one run.
const ROWS: usize = 20;

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
    let Lawful { fit, evidence, two_stages } =
        shown(&mut study, "", |study| with_its_law(&args.effects, |effects| study.calibrate(effects).run()))?;
    let (rig, runs) = (study.rig(), study.runs());
    if let Some(evidence) = evidence {
        tell!(
            "the model's valve closes {}: two stages bring {evidence:.0} of evidence ({EVIDENCE:.0} is strong){}",
            if two_stages { "in two stages" } else { "linearly" },
            if !two_stages && evidence > EVIDENCE {
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
            tell!("warning: {warning}");
        }
    }
    if json {
        let document = json!({ "effects": fit.labels(), "runs": closures.iter().map(document).collect::<Vec<_>>() });
        say!("{document:#}");
    } else {
        say_text!(closures.iter().map(text).collect::<Vec<_>>().join("\n"));
    }
    if let (Some(path), Some(closure)) = (&args.svg, closures.first()) {
        output::check_picture(path)?;
        output::write(path, &chart(closure).to_svg(900.0, 480.0))?;
        tell!("chart: {}", path.display());
    }
    Ok(Outcome::Done)
}

/// Openings that no valve has, beyond what noise does.
const OPENINGS: std::ops::RangeInclusive<f64> = -0.05..=1.05;

/// What to do about a curve that is no valve's.
fn no_valve(closure: &ValveClosure, creep_missing: bool) -> Option<String> {
    let known = closure.curve.opening.iter().copied().filter(|o| o.is_finite());
    let (least, most) = known.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), o| (l.min(o), m.max(o)));
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

fn document(closure: &ValveClosure) -> serde_json::Value {
    let error = |e: LawError| json!({ "first_rise_rms_m": e.first_rise_m, "record_rms_m": e.record_m });
    let shift = |s: &Shift| {
        json!({
            "what": s.what, "largest_change_of_opening": s.largest, "rms_change_of_opening": s.rms,
            "effective_closing_time_s": s.effective_closing_s, "two_stage": two_stage(s.two_stage),
            "time_s": s.curve.time_s, "opening": s.curve.opening,
        })
    };
    json!({
        "file": closure.file,
        "sensor": closure.sensor,
        "fitted_closing_time_s": closure.fitted_closing_s,
        "effective_closing_time_s": closure.effective_closing_s,
        "two_stage": two_stage(closure.two_stage),
        "errors": { "fitted": error(closure.errors.fitted), "two_stage": error(closure.errors.two_stage),
                    "curve": error(closure.errors.curve) },
        "shifts": closure.shifts.iter().map(shift).collect::<Vec<_>>(),
        "time_s": closure.curve.time_s,
        "velocity_m_s": closure.curve.velocity_m_s,
        "opening": closure.curve.opening,
    })
}

fn two_stage(law: TwoStage) -> serde_json::Value {
    json!({ "inflection_s": law.inflection_s, "inflection_opening": law.inflection_opening,
            "closing_time_s": law.closing_s, "rms_of_opening": law.rms, "straight": law.straight() })
}

/// What the laws leave of the head, and how the curve moves with the pipe's own parameters.
fn worth(closure: &ValveClosure) -> String {
    let mut errors = Table::new(&["valve closes by", "first rise, rms m", "whole record, rms m"]);
    let laws = [
        ("the fitted model's law", closure.errors.fitted),
        ("the nearest two stages", closure.errors.two_stage),
        ("the curve itself", closure.errors.curve),
    ];
    for (law, error) in laws {
        errors.row([law.into(), significant(error.first_rise_m, 3), significant(error.record_m, 3)]);
    }
    let mut shifts =
        Table::new(&["with", "opening moves by", "rms", "effective, s", "inflection, s", "opening", "closed, s"]);
    let row = |what: &str, moved: Option<(f64, f64)>, effective: Option<f64>, law: TwoStage| {
        let moved = moved.map_or(["".into(), "".into()], |(largest, rms)| [fixed(largest, 4), fixed(rms, 4)]);
        let seconds = |s: f64| fixed(s, 4);
        let [largest, rms] = moved;
        let effective = effective.map_or(String::new(), seconds);
        [
            what.into(),
            largest,
            rms,
            effective,
            if law.straight() { "–".into() } else { seconds(law.inflection_s) },
            if law.straight() { "–".into() } else { fixed(law.inflection_opening, 3) },
            seconds(law.closing_s),
        ]
    };
    shifts.row(row("as fitted", None, closure.effective_closing_s, closure.two_stage));
    for s in &closure.shifts {
        shifts.row(row(&s.what, Some((s.largest, s.rms)), s.effective_closing_s, s.two_stage));
    }
    format!("\nResidual head at {}:\n{errors}\nInfluence of the pipe on the curve:\n{shifts}", closure.sensor)
}

fn chart(closure: &ValveClosure) -> LineChart {
    let line = |n: usize, label: &str, time_s: &[f64], opening: &dyn Fn(usize) -> f64| Series {
        label: label.into(),
        points: time_s.iter().enumerate().map(|(i, t)| (*t, opening(i))).filter(|p| p.1.is_finite()).collect(),
        style: Style::line(n),
    };
    let (curve, law) = (&closure.curve, closure.two_stage);
    let mut series = vec![
        line(0, "reconstructed from the head", &curve.time_s, &|i| curve.opening[i]),
        line(1, "nearest two stages", &curve.time_s, &|i| law.opening(curve.time_s[i])),
    ];
    // Five lines can be told apart; a standard error moves the curve by less than a line's width.
    let drawn = closure.shifts.iter().filter(|s| s.what.starts_with("wave speed") && s.what.ends_with('%'));
    let drawn = drawn.chain(closure.shifts.iter().filter(|s| s.what == "creep left out"));
    series.extend(drawn.enumerate().map(|(n, s)| line(n + 2, &s.what, &s.curve.time_s, &|i| s.curve.opening[i])));
    LineChart {
        title: format!("{}: how the valve closed, by {}", closure.file, closure.sensor),
        x_label: "time after the start of the closure, s".into(),
        y_label: "opening, relative".into(),
        series,
        ..LineChart::default()
    }
}

fn text(closure: &ValveClosure) -> String {
    let law = closure.two_stage;
    let mut out = format!("{}, by {}:\n", closure.file, closure.sensor);
    let _ = writeln!(out, "  closing time of the fitted model   {:.4} s", closure.fitted_closing_s);
    if let Some(effective_s) = closure.effective_closing_s {
        let _ = writeln!(out, "  effective (from 0.9 to 0.1, times 1/0.8)  {effective_s:.4} s");
    }
    let _ = if law.straight() {
        writeln!(
            out,
            "  nearest two stages   nearly a straight line, closed at {:.4} s, inflection undetermined; rms error of the opening {:.3}",
            law.closing_s, law.rms
        )
    } else {
        writeln!(
            out,
            "  nearest two stages   to {:.3} of the opening in {:.4} s, closed at {:.4} s; rms error of the opening {:.3}",
            law.inflection_opening, law.inflection_s, law.closing_s, law.rms
        )
    };
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
    out + &worth(closure)
}
