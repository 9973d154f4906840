//! What a recording shows, for people.

use std::fmt::Write as _;

use crate::recording::Recording;
use crate::report::text::number::{error_m, plus_minus, to_error};
use crate::shown::Shown as _;
use crate::signal::doubts::doubts;
use crate::signal::{Estimate, Features};

/// What a recording shows, for people.
pub fn table(recording: &Recording, f: &Features) -> String {
    let mut out = String::new();
    let shown = |e: Option<Estimate>, unit: &str| {
        e.map_or("not visible".into(), |e| format!("{} {unit}", plus_minus(e.value, e.standard_error)))
    };
    let c = &f.closure;
    let source = if c.from_trigger { "trigger" } else { "pressure" };
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:<22} {text}");
    };
    line("rig", recording.rig.name.clone());
    for (key, value) in &recording.run.notes {
        line(&format!("note {}", key.shown()), value.shown().into_owned());
    }
    line("temperature", format!("{:.2} °C", f.temperature_degc));
    line("closure starts", format!("{} s ({source})", plus_minus(c.start_s, c.start_se_s)));
    let ends = c.end_s.map(|end| {
        // the end is read from the same record, no better than the start
        format!("{} s, after {} s", to_error(end, c.start_se_s), to_error(end - c.start_s, c.start_se_s))
    });
    let slow = if c.slow { ", slower than 2L/a" } else { "" };
    line("closure ends", format!("{}{slow}", ends.unwrap_or("not visible".into())));
    line("velocity before", shown(f.steady_velocity_m_s, "m/s"));
    line("period", shown(f.period, "s"));
    let damping: Vec<String> = f.damping_per_cycle.iter().take(5).map(|d| format!("{d:.3}")).collect();
    line("damping per cycle", if damping.is_empty() { "not visible".into() } else { damping.join("  ") });
    let w = &f.wave_speed;
    let not_carried = || if c.slow { "not carried: the closure is slower than 2L/a" } else { "not visible" }.to_owned();
    let carried = |e: Option<Estimate>| e.map_or_else(not_carried, |e| shown(Some(e), "m/s"));
    let crossings = w.crossings.map(|c| {
        format!(
            "{} m/s (range {} to {})",
            plus_minus(c.value, c.standard_error),
            to_error(c.low, c.standard_error),
            to_error(c.high, c.standard_error)
        )
    });
    line("wave speed, crossings", crossings.unwrap_or_else(not_carried));
    line("  two sensors", if f.sensors.len() > 1 { carried(w.arrival) } else { shown(None, "m/s") });
    line("  Joukowsky", if f.steady_velocity_m_s.is_some() { carried(w.joukowsky) } else { shown(None, "m/s") });
    line("  period, 4L/T", shown(w.period, "m/s"));
    let _ = writeln!(
        out,
        "\n{:<10} {:>8} {:>7} {:>5} {:>12} {:>12} {:>12} {:>10} {:>8} {:>9}",
        "sensor", "at m", "samples", "gaps", "before m", "after m", "arrival s", "peak m", "extrema", "noise m"
    );
    let known = |e: Option<Estimate>| e.map_or("–".into(), |e| to_error(e.value, e.standard_error));
    // no sensor reads a head to less than a millimetre, however quiet its record is
    let head = |e: Option<(f64, f64)>| e.map_or("–".into(), |(value, error)| to_error(value, error.max(1e-3)));
    let pair = |e: Estimate| (e.value, e.standard_error);
    for s in &f.sensors {
        let _ = writeln!(
            out,
            "{:<10} {:>8.2} {:>7} {:>5} {:>12} {:>12} {:>12} {:>10} {:>8} {:>9}{}",
            s.name,
            s.position_m,
            s.samples,
            recording.series[s.sensor].gaps.len(),
            head(Some(pair(s.steady_before_m))),
            head(s.steady_after_m.map(pair)),
            known(s.front_arrival_s),
            head(s.first_peak.map(|e| (e.head_m, s.noise.white_sd_m))),
            s.extrema.len(),
            error_m(s.noise.white_sd_m),
            if s.noise.corners.is_some() {
                " (interpolated)".to_owned()
            } else if s.noise.coloured {
                format!(" (autocorrelated: {} in all)", error_m(s.noise.total_sd_m))
            } else {
                String::new()
            },
        );
    }
    for (i, doubt) in doubts(&recording.rig, f).iter().enumerate() {
        let _ = writeln!(out, "{}note: {doubt}", if i == 0 { "\n" } else { "" });
    }
    out
}
