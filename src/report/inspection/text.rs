//! What a recording shows, for people.

use std::fmt::Write as _;

use crate::recording::Recording;
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
    let ends = c.end_s.map(|end| format!("{end:.4} s, after {:.4} s", end - c.start_s));
    line("closure ends", ends.unwrap_or("not visible: slower than 2L/a".into()));
    line("velocity before", shown(f.steady_velocity_m_s, "m/s"));
    line("period", shown(f.period, "s"));
    let damping: Vec<String> = f.damping_per_cycle.iter().take(5).map(|d| format!("{d:.3}")).collect();
    line("damping per cycle", if damping.is_empty() { "not visible".into() } else { damping.join("  ") });
    let w = &f.wave_speed;
    let crossings = w.crossings.map(|c| {
        let note = if c.slow_closure { ", closure slower than 2L/a" } else { "" };
        format!("{} m/s (range {:.1} to {:.1}{note})", plus_minus(c.value, c.standard_error), c.low, c.high)
    });
    line("wave speed, crossings", crossings.unwrap_or("not visible".into()));
    line("  two sensors", shown(w.arrival, "m/s"));
    line("  Joukowsky", shown(w.joukowsky, "m/s"));
    let _ = writeln!(
        out,
        "\n{:<10} {:>8} {:>7} {:>5} {:>12} {:>12} {:>12} {:>10} {:>8} {:>9}",
        "sensor", "at m", "samples", "gaps", "before m", "after m", "arrival s", "peak m", "extrema", "noise m"
    );
    let number = |v: Option<f64>, digits: usize| v.map_or("-".into(), |v| format!("{v:.digits$}"));
    for s in &f.sensors {
        let _ = writeln!(
            out,
            "{:<10} {:>8.2} {:>7} {:>5} {:>12.3} {:>12} {:>12} {:>10} {:>8} {:>9.4}{}",
            s.name,
            s.position_m,
            s.samples,
            recording.series[s.sensor].gaps.len(),
            s.steady_before_m.value,
            number(s.steady_after_m.map(|e| e.value), 3),
            number(s.front_arrival_s.map(|e| e.value), 5),
            number(s.first_peak.map(|e| e.head_m), 3),
            s.extrema.len(),
            s.noise.white_sd_m,
            if s.noise.coloured {
                format!(" (autocorrelated: {:.4} in all)", s.noise.total_sd_m)
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

/// A value and its standard error in as many decimals as give the error two digits.
fn plus_minus(value: f64, standard_error: f64) -> String {
    if !standard_error.is_finite() {
        return format!("{value:.4} ± {standard_error}");
    }
    // what rounding leaves of readings that do not differ is no error
    if standard_error <= 1e-9 * value.abs() {
        return format!("{value:.4} ± 0");
    }
    let decimals = (1.0 - standard_error.log10().floor()).clamp(0.0, 9.0) as usize;
    format!("{value:.decimals$} ± {standard_error:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::plus_minus;

    #[test]
    fn an_error_shows_two_digits_of_itself() {
        assert_eq!(plus_minus(0.5021, 0.000_012_3), "0.502100 ± 0.000012");
        assert_eq!(plus_minus(395.1, 12.4), "395 ± 12");
        assert_eq!(plus_minus(1.25, 0.2), "1.25 ± 0.20");
        assert_eq!(plus_minus(1.25, 0.0), "1.2500 ± 0");
        assert_eq!(plus_minus(0.458995, 1e-17), "0.4590 ± 0");
    }
}
