//! `surgescope inspect`: what a recording tells without a model.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::{Value, json};

use crate::cli::{CommandResult, Outcome};
use crate::recording::Recording;
use crate::rig::Rig;
use crate::signal::doubts::doubts;
use crate::signal::{Estimate, Features, SensorFeatures, inspect};

/// Arguments of `inspect`.
///
/// With `--json`: `file`, `temperature_degC`, `closure` {`start_s`, `start_standard_error_s`, `end_s`, `from_trigger`,
/// `pressure_onset_s`}, `flow_m3_s`, `steady_velocity_m_s`, `period_s`, `damping_per_cycle`, `wave_speed_m_s` {`joukowsky`,
/// `crossings` {`value`, `standard_error`, `low`, `high`, `slow_closure`}, `arrival`}, `reference_sensor` and `sensors` [{`name`,
/// `position_m`, `samples`, `gaps`, `interval_s`, `noise` {`white_sd_m`, `total_sd_m`, `coloured`, `lag1_autocorrelation`,
/// `effective_fraction`, `quantum_m`}, `steady_before_m`, `steady_after_m`, `front_arrival_s`, `first_peak`, `extrema`
/// [{`cycle`, `peak`, `time_s`, `head_m`}], `damping_per_cycle`}], `doubts` (sentences on what cannot all be right), `notes` [{`key`, `value`}]. What has an uncertainty is {`value`, `standard_error`}; what the
/// recording does not show is null.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The recording.
    recording: PathBuf,
    /// A rig to read it with, instead of the one that is stored in it; sensors are matched by their names.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
}

/// Runs it.
///
/// # Errors
/// An unreadable recording, a rig that does not fit it, or a recording without a closure.
pub fn run(args: Args, json: bool) -> CommandResult {
    let mut recording = crate::storage::read(&args.recording)?;
    if let Some(rig) = &args.rig {
        recording = recording.on_rig(Rig::load(rig)?)?;
    }
    let features = inspect(&recording)?;
    if json {
        let mut document = document(&recording, &features);
        document["file"] = json!(args.recording);
        crate::cli::say!("{document:#}");
    } else {
        crate::cli::say_text!(table(&recording, &features));
    }
    Ok(Outcome::Done)
}

fn estimate(e: Estimate) -> Value {
    json!({ "value": e.value, "standard_error": e.standard_error })
}

fn document(recording: &Recording, f: &Features) -> Value {
    let crossings = f.wave_speed.crossings.map(|c| {
        json!({ "value": c.value, "standard_error": c.standard_error, "low": c.low, "high": c.high,
                "slow_closure": c.slow_closure })
    });
    json!({
        "notes": recording.run.notes.iter().map(|(k, v)| json!({ "key": k, "value": v })).collect::<Vec<_>>(),
        "temperature_degC": f.temperature_degc,
        "closure": {
            "start_s": f.closure.start_s,
            "start_standard_error_s": f.closure.start_se_s,
            "end_s": f.closure.end_s,
            "from_trigger": f.closure.from_trigger,
            "pressure_onset_s": f.closure.pressure_onset_s,
        },
        "flow_m3_s": f.flow_m3_s.map(estimate),
        "steady_velocity_m_s": f.steady_velocity_m_s.map(estimate),
        "period_s": f.period.map(estimate),
        "damping_per_cycle": f.damping_per_cycle,
        "wave_speed_m_s": {
            "joukowsky": f.wave_speed.joukowsky.map(estimate),
            "crossings": crossings,
            "arrival": f.wave_speed.arrival.map(estimate),
        },
        "reference_sensor": f.sensors.get(f.reference).map(|s| &s.name),
        "doubts": doubts(&recording.rig, f),
        "sensors": f.sensors.iter().map(|s| sensor(recording, s)).collect::<Vec<_>>(),
    })
}

fn sensor(recording: &Recording, s: &SensorFeatures) -> Value {
    let extrema: Vec<Value> = s
        .extrema
        .iter()
        .map(|e| json!({ "cycle": e.cycle, "peak": e.peak, "time_s": e.time_s, "head_m": e.head_m }))
        .collect();
    json!({
        "name": s.name,
        "position_m": s.position_m,
        "samples": s.samples,
        "gaps": recording.series[s.sensor].gaps.len(),
        "interval_s": s.interval_s,
        "noise": {
            "white_sd_m": s.noise.white_sd_m,
            "total_sd_m": s.noise.total_sd_m,
            "coloured": s.noise.coloured,
            "lag1_autocorrelation": s.noise.lag1_autocorrelation,
            "effective_fraction": s.noise.effective_fraction,
            "quantum_m": s.noise.quantum_m,
            "line": s.noise.line.map(|line| json!({
                "frequency_hz": line.cycles_per_sample / s.interval_s, "amplitude_m": line.amplitude_m,
            })),
        },
        "steady_before_m": estimate(s.steady_before_m),
        "steady_after_m": s.steady_after_m.map(estimate),
        "front_arrival_s": s.front_arrival_s.map(estimate),
        "first_peak": s.first_peak.map(|e| json!({ "time_s": e.time_s, "head_m": e.head_m })),
        "extrema": extrema,
        "damping_per_cycle": s.damping_per_cycle,
    })
}

/// What a recording shows, for people.
pub fn table(recording: &Recording, f: &Features) -> String {
    let mut out = String::new();
    let shown = |e: Option<Estimate>, unit: &str| {
        e.map_or("not to be seen".into(), |e| format!("{} {unit}", plus_minus(e.value, e.standard_error)))
    };
    let c = &f.closure;
    let source = if c.from_trigger { "trigger" } else { "pressure" };
    let mut line = |name: &str, text: String| {
        let _ = writeln!(out, "{name:<22} {text}");
    };
    line("rig", recording.rig.name.clone());
    for (key, value) in &recording.run.notes {
        line(&format!("note {key}"), value.clone());
    }
    line("temperature", format!("{:.2} °C", f.temperature_degc));
    line("closure starts", format!("{} s ({source})", plus_minus(c.start_s, c.start_se_s)));
    let ends = c.end_s.map(|end| format!("{end:.4} s, after {:.4} s", end - c.start_s));
    line("closure ends", ends.unwrap_or("not to be seen: slower than 2L/a".into()));
    line("velocity before", shown(f.steady_velocity_m_s, "m/s"));
    line("period", shown(f.period, "s"));
    let damping: Vec<String> = f.damping_per_cycle.iter().take(5).map(|d| format!("{d:.3}")).collect();
    line("damping per cycle", if damping.is_empty() { "not to be seen".into() } else { damping.join("  ") });
    let w = &f.wave_speed;
    let crossings = w.crossings.map(|c| {
        let note = if c.slow_closure { ", closure slower than 2L/a" } else { "" };
        format!("{} m/s (range {:.1} to {:.1}{note})", plus_minus(c.value, c.standard_error), c.low, c.high)
    });
    line("wave speed, crossings", crossings.unwrap_or("not to be seen".into()));
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
            if s.noise.coloured { format!(" (coloured: {:.4} in all)", s.noise.total_sd_m) } else { String::new() },
        );
    }
    for (i, doubt) in doubts(&recording.rig, f).iter().enumerate() {
        let _ = writeln!(out, "{}note: {doubt}", if i == 0 { "\n" } else { "" });
    }
    out
}

/// A value and its standard error in as many decimals as give the error two digits.
fn plus_minus(value: f64, standard_error: f64) -> String {
    if !(standard_error > 0.0 && standard_error.is_finite()) {
        return format!("{value:.4} ± {standard_error}");
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
    }
}
