//! Frequency response of record and model: amplitude and phase of the head at the pipe's odd harmonics, both through
//! one window ([`crate::signal::harmonics`]), from the end of the closure to the end of the record.

use crate::fit::problem::objective::odd_harmonics;
use crate::signal::harmonics::{Response, Tone, Window};

/// Measured and modelled series of one sensor.
#[derive(Debug, Clone, Copy)]
pub struct Traces<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its run.
    pub file: &'a str,
    /// Times after the start of the closure, s.
    pub time_s: &'a [f64],
    /// Measured head, m.
    pub measured_m: &'a [f64],
    /// Modelled head at the same times, m.
    pub model_m: Option<&'a [f64]>,
    /// Noise of the measurement, m.
    pub noise_m: f64,
}

/// One odd harmonic.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Harmonic {
    /// 1, 3, 5, …
    pub number: usize,
    /// `number · a/4L`: its frequency in a frictionless elastic pipe, Hz.
    pub ideal_hz: f64,
    /// Its frequency in the record over `ideal_hz`, less 1.
    #[serde(rename = "shift_percent", serialize_with = "percent")]
    pub shift: f64,
    /// The record's peak.
    pub record: Tone,
    /// The model at the record's frequency.
    pub model: Option<Tone>,
    /// The model's own peak near it.
    pub model_peak: Option<Tone>,
}

/// A share as it is shown.
fn percent<S: serde::Serializer>(share: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.serialize_f64(100.0 * share)
}

/// The response at one sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorResponse {
    /// Sensor.
    pub name: String,
    /// Run.
    pub file: String,
    /// The window, s after the start of the closure.
    pub window: Window,
    /// The record's response.
    pub record: Response,
    /// The model's.
    pub model: Option<Response>,
    /// Amplitude that the noise has at any frequency, rms, m.
    pub noise_floor_m: f64,
    /// The harmonics above the noise.
    pub harmonics: Vec<Harmonic>,
}

/// The response at a sensor of a pipe whose period is `period_s` (4L/a), the closure taking `closing_s`; none where the
/// record lasts less than three periods after it.
pub fn response(traces: &Traces, period_s: f64, closing_s: f64) -> Option<SensorResponse> {
    let to_s = *traces.time_s.last()?;
    let seen = |period_s: f64| {
        let window = Window::new(closing_s, to_s, period_s)?;
        let record = Response::of(&window, traces.time_s, traces.measured_m)?;
        let harmonics = odd_harmonics(&record, 1.0 / period_s, traces.noise_m);
        Some((window, record, harmonics))
    };
    let first = seen(period_s)?;
    // The period that the record shows sets better edges.
    let measured_s = first.2.first().map(|(_, tone)| 1.0 / tone.frequency_hz);
    let (window, record, found) = measured_s.and_then(seen).unwrap_or(first);
    let model = traces.model_m.and_then(|model| Response::of(&window, traces.time_s, model));
    let harmonic = |(number, tone): (usize, Tone)| {
        let near = 0.6 * found.first().map_or(1.0 / period_s, |(_, t)| t.frequency_hz);
        let ideal_hz = number as f64 / period_s;
        Harmonic {
            number,
            ideal_hz,
            shift: tone.frequency_hz / ideal_hz - 1.0,
            record: tone,
            model: model.as_ref().map(|m| m.at(tone.frequency_hz)),
            model_peak: model.as_ref().and_then(|m| m.peak(tone.frequency_hz - near, tone.frequency_hz + near)),
        }
    };
    Some(SensorResponse {
        name: traces.name.to_owned(),
        file: traces.file.to_owned(),
        noise_floor_m: record.white * traces.noise_m,
        harmonics: found.iter().copied().map(harmonic).collect(),
        window,
        record,
        model,
    })
}

/// The shortest way from one angle to another, rad, from -π to π.
pub fn turned(from_rad: f64, to_rad: f64) -> f64 {
    let difference = to_rad - from_rad;
    difference - std::f64::consts::TAU * (difference / std::f64::consts::TAU).round()
}
