//! How a valve closed, for the terminal.

use std::fmt::Write as _;

use crate::fit::problem::valve_curve::TwoStage;
use crate::report::text::number::{fixed, significant};
use crate::report::text::table::Table;
use crate::valve::curve::ValveClosure;

/// Rows of the table of one run.
const ROWS: usize = 20;

/// Opening against time, the nearest two stages, and how the pipe influences the curve.
pub fn text(closure: &ValveClosure) -> String {
    let law = closure.two_stage;
    let mut out = format!("{}, by {}:\n", closure.file, closure.sensor);
    let _ =
        writeln!(out, "  closing time of the fitted model           {} s", significant(closure.fitted_closing_s, 3));
    if let Some(effective_s) = closure.effective_closing_s {
        let _ = writeln!(out, "  effective (from 0.9 to 0.1, times 1/0.8)   {} s", significant(effective_s, 3));
    }
    let _ = if law.straight() {
        writeln!(
            out,
            "  nearest two stages                         nearly a straight line, closed at {} s, inflection undetermined; rms error of the opening {}",
            significant(law.closing_s, 3),
            significant(law.rms, 2)
        )
    } else {
        writeln!(
            out,
            "  nearest two stages                         to {} of the opening in {} s, closed at {} s; rms error of the opening {}",
            significant(law.inflection_opening, 2),
            significant(law.inflection_s, 3),
            significant(law.closing_s, 3),
            significant(law.rms, 2)
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

/// The residual head under each law, and how the curve changes with the parameters of the pipe.
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
