//! In which frequencies a model errs: the spectrum of its residual at each sensor, against the noise and the pipe's
//! harmonics.

use std::fmt::Write;

use crate::fit::outcome::fit::SensorFit;
use crate::report::Stage;
use crate::report::html::figures;
use crate::report::html::page::colour;
use crate::report::svg::{LineChart, Series, Style};
use crate::report::view::curves::find;
use crate::signal::spectrum::Spectrum;

/// Harmonics up to which a spectrum is drawn.
const HARMONICS: f64 = 20.0;
/// Most points of a curve: of each stretch the highest is kept.
const POINTS: usize = 600;
/// Share of the noise's level below which nothing is drawn: chance makes some frequencies as quiet as one likes.
const FLOOR: f64 = 0.2;

pub(crate) fn section(models: &[Stage]) -> String {
    let Some(last) = models.last() else { return String::new() };
    // The start and the result tell it; what lies between would crowd the chart.
    let shown: Vec<usize> = if models.len() > 1 { vec![0, models.len() - 1] } else { vec![0] };
    let mut plates = Vec::new();
    for run in &last.fit.runs {
        for sensor in &run.sensors {
            let residuals = shown.iter().filter_map(|&i| {
                let fit = find(models[i].fit, &run.file, &sensor.name)?;
                Some((i, Spectrum::of(&fit.time_s, &residual(fit))?))
            });
            let residuals: Vec<(usize, Spectrum)> = residuals.collect();
            let Some(first_hz) = fundamental_hz(sensor).filter(|_| !residuals.is_empty()) else { continue };
            let title = figures::title(last.fit, &run.file, sensor);
            plates.push((title, chart(models, &residuals, first_hz, sensor.white_noise_m)));
        }
    }
    if plates.is_empty() {
        return String::new();
    }
    let mut out = String::from("<section class=\"spectrum\" id=\"spectrum\"><h2>Error by frequency</h2>\n");
    out.push_str(&figures::plates(&plates));
    let _ = writeln!(
        out,
        r#"<p class="note">Amplitude spectrum of model − measured, over the whole record; where frequencies are too close to be drawn separately, the highest amplitude. Dotted: odd multiples of the measured fundamental, the harmonics of a pipe between a supply and a closed valve. Dashed: the sensor’s noise level, which white noise exceeds at a third of all frequencies.</p>
</section>"#
    );
    out
}

fn residual(fit: &SensorFit) -> Vec<f64> {
    fit.model_m.iter().zip(&fit.measured_m).map(|(m, y)| m - y).collect()
}

/// The fundamental of the measured head, Hz: its highest peak near what the measured peaks say.
fn fundamental_hz(sensor: &SensorFit) -> Option<f64> {
    let peaks: Vec<_> = sensor.extrema.iter().filter(|e| e.peak).collect();
    let (first, last) = (peaks.first()?, peaks.last()?);
    let cycles = last.cycle.checked_sub(first.cycle).filter(|n| *n > 0)?;
    let about_hz = cycles as f64 / (last.time_s - first.time_s);
    let spectrum = Spectrum::of(&sensor.time_s, &sensor.measured_m)?;
    spectrum.peak_hz(0.8 * about_hz, 1.25 * about_hz)
}

fn chart(models: &[Stage], residuals: &[(usize, Spectrum)], first_hz: f64, noise_m: f64) -> LineChart {
    let most_hz = (HARMONICS + 0.5) * first_hz;
    let level = residuals.first().map_or(f64::NAN, |(_, s)| s.white * noise_m);
    let least = if level > 0.0 { FLOOR * level } else { 0.0 };
    let mut series: Vec<Series> = residuals
        .iter()
        .map(|(i, spectrum)| Series {
            label: models[*i].title.clone(),
            points: highest(spectrum, most_hz).map(|(f, a)| (f, a.max(least))).collect(),
            style: Style::line(colour(*i, models.len())),
        })
        .collect();
    if level > 0.0 {
        let end = series.iter().flat_map(|s| s.points.last()).map(|p| p.0).fold(0.0, f64::max);
        let style = Style { class: "limit", colour: "#222", dash: "5 4", width: 1.5, points: false, area: false };
        series.push(Series { label: "noise".into(), points: vec![(0.0, level), (end, level)], style });
    }
    LineChart {
        x_label: "frequency, Hz".into(),
        y_label: "amplitude, m".into(),
        series,
        log_y: true,
        marks: (0..10).map(|k| 2 * k + 1).map(|n| (f64::from(n) * first_hz, n.to_string())).collect(),
        ..LineChart::default()
    }
}

/// The highest point of each of a few hundred stretches, without the one at frequency 0.
fn highest(spectrum: &Spectrum, most_hz: f64) -> impl Iterator<Item = (f64, f64)> {
    let points: Vec<(f64, f64)> = spectrum.points(most_hz).skip(1).collect();
    let size = points.len().div_ceil(POINTS).max(1);
    let highest: Vec<(f64, f64)> =
        points.chunks(size).filter_map(|c| c.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))).collect();
    highest.into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::compare::ExtremumError;
    use std::f64::consts::TAU;

    fn ringing(frequency_hz: f64) -> SensorFit {
        let time_s: Vec<f64> = (0..4000).map(|i| f64::from(i) * 2.5e-3).collect();
        let wave = |t: f64| {
            20.0 + (-0.1 * t).exp() * ((TAU * frequency_hz * t).sin() + 0.5 * (3.0 * TAU * frequency_hz * t).sin())
        };
        SensorFit {
            name: "P1".into(),
            position_m: 1.0,
            measured_m: time_s.iter().map(|&t| wave(t)).collect(),
            model_m: time_s.iter().map(|&t| wave(t) + 0.2 * (5.0 * TAU * frequency_hz * t).sin()).collect(),
            band_m: Vec::new(),
            noise_m: 0.01,
            white_noise_m: 0.01,
            rmse_m: 0.1,
            start_rmse_m: 1.0,
            before_m: None,
            // Found a tenth of a cycle late at the last one, as peaks of changing shape are.
            extrema: [(1usize, 0.25), (11, 10.35)]
                .map(|(cycle, at)| ExtremumError {
                    cycle,
                    peak: true,
                    time_s: at / frequency_hz,
                    measured_m: 1.0,
                    model_m: 1.0,
                    phase_s: 0.0,
                })
                .to_vec(),
            time_s,
        }
    }

    #[test]
    fn the_fundamental_is_found_better_than_peaks_tell() {
        let found = fundamental_hz(&ringing(1.3)).unwrap();
        assert!((found / 1.3 - 1.0).abs() < 0.01, "{found}");
    }

    #[test]
    fn an_error_in_the_fifth_harmonic_stands_there() {
        let sensor = ringing(1.3);
        let spectrum = Spectrum::of(&sensor.time_s, &residual(&sensor)).unwrap();
        let (at, height) = highest(&spectrum, 27.0).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
        assert!((at - 6.5).abs() < 0.1 && (height - 0.2).abs() < 0.01, "{at} Hz, {height} m");
        assert!(highest(&spectrum, 27.0).count() <= POINTS);
    }
}
