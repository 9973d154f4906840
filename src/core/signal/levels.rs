//! Steady levels: head before and after, flow and temperature of the run.

use crate::recording::{Recording, Series};
use crate::rig::SensorKind;
use crate::signal::features::Estimate;
use crate::signal::noise::{Noise, despiked};
use crate::signal::trace::{Trace, mean};

/// Level just before the front: from the newest part of the lead-in, as a supply may drift over a longer one. With
/// fewer than three quiet samples it is the head from which the front starts.
pub(crate) fn before(lead: &[f64], base_m: f64, longest: usize, noise: &Noise) -> Estimate {
    let lead = &despiked(&lead[lead.len().saturating_sub(longest)..]);
    if lead.len() < 3 {
        return Estimate { value: base_m, standard_error: noise.white_sd_m.max(f64::MIN_POSITIVE) };
    }
    let independent = (lead.len() as f64 * noise.effective_fraction).max(1.0);
    Estimate { value: mean(lead), standard_error: noise.total_sd_m / independent.sqrt() }
}

/// Mean over the last whole period of the record; its error includes the change since the period before. `None` if the
/// record has fewer than two periods after the closure.
pub(crate) fn after(trace: &Trace, start_s: f64, period_s: f64, noise: &Noise) -> Option<Estimate> {
    let period = (period_s / trace.step_s).round() as usize;
    let (start, end) = (trace.index(start_s), trace.len());
    if period < 4 || end < start + 2 * period + period / 2 || !trace.intact(end - 2 * period..end) {
        return None;
    }
    let last = mean(&trace.head_m[end - period..]);
    let previous = mean(&trace.head_m[end - 2 * period..end - period]);
    let scatter = noise.white_sd_m / (period as f64).sqrt();
    Some(Estimate { value: last, standard_error: scatter.hypot(last - previous) })
}

/// Mean temperature of the run, °C: from the first temperature sensor with samples, or from the rig file.
pub fn temperature_degc(recording: &Recording) -> f64 {
    of_kind(recording, SensorKind::Temperature)
        .map(|(sensor, series)| {
            let unit = recording.rig.sensors[sensor].unit;
            let values: Vec<f64> = finite(series).map(|(_, v)| unit.to_si(v, 1000.0)).collect();
            mean(&values)
        })
        .unwrap_or(recording.rig.fluid.temperature_degc)
}

/// Flow before the closure, m³/s, from the first flow sensor with samples: the mean of its last five seconds, or else
/// its last reading.
pub(crate) fn flow_m3_s(recording: &Recording, start_s: f64) -> Option<Estimate> {
    let (sensor, series) = of_kind(recording, SensorKind::Flow)?;
    let sensor = &recording.rig.sensors[sensor];
    let before: Vec<(f64, f64)> = finite(series).filter(|(t, _)| *t <= start_s).collect();
    // a meter that is read now and then, or once by hand, counts by its last reading
    let (last_s, _) = before.last()?;
    let since_s = last_s.min(start_s - 5.0);
    let recent = before.iter().filter(|(t, _)| *t >= since_s);
    let flows: Vec<f64> = recent.map(|(_, v)| sensor.unit.to_si(*v, 1000.0)).collect();
    let value = mean(&flows);
    let n = flows.len() as f64;
    let variance = flows.iter().map(|q| (q - value).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    // the data sheet's accuracy is a bound: divided by √3 it is the standard deviation of a uniform error
    let sheet = match (sensor.accuracy_percent_fs, sensor.range) {
        (Some(percent), Some([lo, hi])) => {
            let full = sensor.unit.to_si(hi, 1000.0) - sensor.unit.to_si(lo, 1000.0);
            percent / 100.0 * full / 3f64.sqrt()
        }
        _ => 0.0,
    };
    let scatter = if flows.len() > 1 { (variance / n).sqrt() } else { 0.01 * value.abs() };
    Some(Estimate { value, standard_error: scatter.hypot(sheet) })
}

/// The finite samples.
pub(crate) fn finite(series: &Series) -> impl Iterator<Item = (f64, f64)> + '_ {
    series.time_s.iter().copied().zip(series.value.iter().copied()).filter(|(t, v)| t.is_finite() && v.is_finite())
}

/// The first sensor of a kind that has samples.
pub(crate) fn of_kind(recording: &Recording, kind: SensorKind) -> Option<(usize, &Series)> {
    let sensors = recording.rig.sensors.iter().zip(&recording.series).enumerate();
    sensors
        .filter(|(_, (sensor, _))| sensor.kind == kind)
        .map(|(i, (_, series))| (i, series))
        .find(|(_, series)| finite(series).next().is_some())
}
