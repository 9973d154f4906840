//! A frequency response as text, JSON, pictures and page.

use std::f64::consts::PI;
use std::fmt::Write as _;

use serde::Serialize;

use crate::fit::validate::frequency::{Harmonic, SensorResponse, turned};
use crate::report::svg::{LineChart, Series, Style};
use crate::report::text::number::{error_m, fixed, signed, significant};
use crate::report::text::table::Table;
use crate::signal::harmonics::Response;

/// Most points of a curve: of each stretch the highest is kept.
const POINTS: usize = 700;
/// Share of the noise's level below which nothing is drawn: chance makes some frequencies as quiet as one likes.
const FLOOR: f64 = 0.2;
/// Times the noise's level above which a phase is drawn.
const CLEAR: f64 = 3.0;
/// Shares of frequency and amplitude of the fundamental within which a model has it.
const HAS_IT: (f64, f64) = (0.005, 0.02);

/// Where the window comes from, for all who read the numbers.
pub const WINDOW: &str = "One window for record and model, from the end of the closure to the end of the record: it rises over one period of the \
    pipe and falls over a whole number of them, so that odd harmonics do not leak into each other; the mean is subtracted. Amplitudes are those of \
    steady sines under that window; a decaying oscillation shows its mean amplitude. Phases are those of a cosine at the window's start.";

/// The fundamental at the first sensor in a sentence, and whether the model has it; none without a model.
pub fn verdict(sensors: &[SensorResponse]) -> (String, Option<bool>) {
    let Some((sensor, h)) = sensors.iter().find_map(|s| Some((s, s.harmonics.first()?))) else {
        return ("No harmonic stands out of the noise.".to_owned(), None);
    };
    let way = if h.shift < 0.0 { "below" } else { "above" };
    let shift = significant(100.0 * h.shift.abs(), 2);
    let sentence = format!(
        "At {} the fundamental, {} Hz, lies {shift}% {way} a/4L, and {} harmonics stand out of the noise",
        sensor.name,
        significant(h.record.frequency_hz, 4),
        sensor.harmonics.len()
    );
    let (Some(model), Some(peak)) = (h.model, h.model_peak) else { return (sentence + ".", None) };
    let (frequency, amplitude) =
        (peak.frequency_hz / h.record.frequency_hz - 1.0, model.amplitude / h.record.amplitude - 1.0);
    let has_it = frequency.abs() < HAS_IT.0 && amplitude.abs() < HAS_IT.1;
    let (frequency, amplitude) = (signed(100.0 * frequency, 2), signed(100.0 * amplitude, 2));
    (format!("{sentence}; the model is off by {frequency}% in frequency and {amplitude}% in amplitude."), Some(has_it))
}

/// Verdict, and tables, one a sensor.
pub fn text(sensors: &[SensorResponse]) -> String {
    let mut out = verdict(sensors).0 + "\n\n";
    for sensor in sensors {
        let _ = writeln!(out, "{}\n{}", heading(sensor), table(sensor));
    }
    out + WINDOW + "\n"
}

/// Sensor, window and noise.
pub fn heading(sensor: &SensorResponse) -> String {
    format!(
        "{}, {}: {:.3} s to {:.3} s after the start of the closure, noise floor {} m",
        sensor.file,
        sensor.name,
        sensor.window.from_s,
        sensor.window.to_s,
        significant(sensor.noise_floor_m, 2)
    )
}

const HEADINGS: [&str; 9] = [
    "<harmonic",
    "<ideal, Hz",
    "<record, Hz",
    "<shift, %",
    "<record, m",
    "<model, m",
    "<phase, rad",
    "<model − record, rad",
    "<model's peak, Hz",
];

/// The cells of the table of harmonics.
pub fn rows(sensor: &SensorResponse) -> Vec<[String; 9]> {
    let cell = |value: Option<f64>, write: fn(f64) -> String| value.map_or(String::new(), write);
    let row = |h: &Harmonic| {
        [
            h.number.to_string(),
            significant(h.ideal_hz, 4),
            significant(h.record.frequency_hz, 4),
            signed(100.0 * h.shift, 2),
            error_m(h.record.amplitude),
            cell(h.model.map(|m| m.amplitude), error_m),
            fixed(h.record.phase_rad, 2),
            cell(h.model.map(|m| turned(h.record.phase_rad, m.phase_rad)), |v| signed(v, 2)),
            cell(h.model_peak.map(|m| m.frequency_hz), |v| significant(v, 4)),
        ]
    };
    sensor.harmonics.iter().map(row).collect()
}

/// The headings of [`rows`].
pub fn headings() -> [&'static str; 9] {
    HEADINGS.map(|h| h.trim_start_matches('<'))
}

fn table(sensor: &SensorResponse) -> String {
    if sensor.harmonics.is_empty() {
        return "no harmonic stands out of the noise\n".to_owned();
    }
    let mut table = Table::new(&HEADINGS);
    rows(sensor).into_iter().for_each(|row| table.row(row));
    table.without_empty_columns().to_string()
}

/// A response as scripts see it.
#[derive(Debug, Serialize)]
pub struct Document<'a> {
    /// Effects of the model; none without one.
    pub effects: Option<Vec<String>>,
    /// In a sentence.
    pub verdict: String,
    /// How frequencies were made.
    pub window: &'static str,
    /// Each sensor.
    pub sensors: Vec<Sensor<'a>>,
}

/// One sensor.
#[derive(Debug, Serialize)]
pub struct Sensor<'a> {
    /// Run.
    pub file: &'a str,
    /// Sensor.
    pub name: &'a str,
    /// The window's beginning and end, s after the start of the closure.
    pub window_s: [f64; 2],
    /// Lengths of the window's rising and falling edge, s.
    pub edges_s: [f64; 2],
    /// Noise at any frequency, rms, m.
    pub noise_floor_m: f64,
    /// The harmonics.
    pub harmonics: &'a [Harmonic],
}

/// The document of `frequency --json`.
pub fn document(sensors: &[SensorResponse], effects: Option<Vec<String>>) -> Document<'_> {
    let all = sensors;
    let of = |s: &SensorResponse| (s.window.from_s, s.window.to_s, s.window.rise_s, s.window.fall_s);
    let sensors = sensors.iter().map(|s| {
        let (from, to, rise, fall) = of(s);
        Sensor {
            file: &s.file,
            name: &s.name,
            window_s: [from, to],
            edges_s: [rise, fall],
            noise_floor_m: s.noise_floor_m,
            harmonics: &s.harmonics,
        }
    });
    Document { effects, verdict: verdict(all).0, window: WINDOW, sensors: sensors.collect() }
}

fn marks(sensor: &SensorResponse) -> Vec<(f64, String)> {
    sensor.harmonics.iter().map(|h| (h.ideal_hz, h.number.to_string())).collect()
}

/// Up to a little beyond the last harmonic.
fn most_hz(sensor: &SensorResponse) -> f64 {
    let first = sensor.harmonics.first().map_or(1.0 / sensor.window.rise_s, |h| h.record.frequency_hz);
    let last = sensor.harmonics.last().map_or(first, |h| h.record.frequency_hz.max(h.ideal_hz));
    last + 1.5 * first
}

/// Amplitude against frequency.
pub fn amplitude(sensor: &SensorResponse) -> LineChart {
    let (most_hz, least) = (most_hz(sensor), FLOOR * sensor.noise_floor_m);
    let mut series = vec![Series {
        label: "record".into(),
        points: highest(&sensor.record, most_hz, least),
        style: Style { width: 4.0, ..Style::measured() },
    }];
    if let Some(model) = &sensor.model {
        let points = highest(model, most_hz, least);
        series.push(Series { label: "model".into(), points, style: Style::line(0) });
    }
    let (level, style) =
        (sensor.noise_floor_m, Style { class: "limit", colour: "#222", dash: "5 4", ..Style::line(0) });
    series.push(Series { label: "noise floor".into(), points: vec![(0.0, level), (most_hz, level)], style });
    LineChart {
        x_label: "frequency, Hz".into(),
        y_label: "amplitude, m".into(),
        series,
        log_y: true,
        marks: marks(sensor),
        ..LineChart::default()
    }
}

/// Phase at the harmonics against frequency.
pub fn phase(sensor: &SensorResponse) -> LineChart {
    let most = most_hz(sensor);
    // Where the record is no more than noise its phase is anything.
    let least = CLEAR * sensor.noise_floor_m;
    let clear = |k: usize| sensor.record.amplitudes.get(k).is_some_and(|a| *a > least);
    let mut series = vec![Series {
        label: "record".into(),
        points: phases(&sensor.record, most, &clear),
        style: Style { width: 4.0, ..Style::measured() },
    }];
    if let Some(model) = &sensor.model {
        series.push(Series { label: "model".into(), points: phases(model, most, &clear), style: Style::line(0) });
    }
    let style = Style { class: "limit", colour: "#222", dash: "1 4", width: 1.0, ..Style::line(0) };
    let ends = vec![(0.0, PI), (most, PI), (f64::NAN, f64::NAN), (0.0, -PI), (most, -PI)];
    series.push(Series { label: "±π".into(), points: ends, style });
    LineChart {
        x_label: "frequency, Hz".into(),
        y_label: "phase, rad".into(),
        series,
        marks: marks(sensor),
        ..LineChart::default()
    }
}

/// Phases where they are clear; where one turns through ±π the line breaks.
fn phases(response: &Response, most_hz: f64, clear: &dyn Fn(usize) -> bool) -> Vec<(f64, f64)> {
    let mut points: Vec<(f64, f64)> = Vec::new();
    for (k, &phase) in response.phases.iter().enumerate().skip(1) {
        let hz = k as f64 * response.step_hz;
        if hz > most_hz {
            break;
        }
        let broken = points.last().is_some_and(|p| (p.1 - phase).abs() > PI);
        if broken || !clear(k) {
            points.push((f64::NAN, f64::NAN));
        }
        if clear(k) {
            points.push((hz, phase));
        }
    }
    points
}

fn highest(response: &Response, most_hz: f64, least: f64) -> Vec<(f64, f64)> {
    let points = response.amplitudes.iter().enumerate().map(|(k, a)| (k as f64 * response.step_hz, *a));
    let points: Vec<(f64, f64)> = points.skip(1).take_while(|(f, _)| *f <= most_hz).collect();
    let size = points.len().div_ceil(POINTS).max(1);
    let top = points.chunks(size).filter_map(|c| c.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)));
    top.map(|(f, a)| (f, a.max(least))).collect()
}

/// Amplitude over phase of the first sensor, as one picture.
pub fn svg(sensor: &SensorResponse) -> String {
    let title = format!("{}, {}", sensor.file, sensor.name);
    let above = LineChart { title, ..amplitude(sensor) }.to_svg(900.0, 420.0);
    let below = phase(sensor).to_svg(900.0, 260.0).replacen("<svg ", "<svg y=\"420\" width=\"900\" height=\"260\" ", 1);
    let above = above.replacen("<svg ", "<svg width=\"900\" height=\"420\" ", 1);
    format!("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 900 680\">{above}{below}</svg>\n")
}
