//! Where and when a model errs: the residual's rms in each cycle at each sensor, in units of the noise, one map a
//! model.

use crate::diagnose::residual_patterns::by_cycle;
use crate::fit::outcome::fit::{Fit, SensorFit};
use crate::report::Stage;
use crate::report::html::matrix::{Cell, matrix};
use crate::report::text::escape::escape;
use crate::report::text::number::significant;

/// Upper ends of the colours, in units of the noise, the same on every page; the last colour has none.
const LEVELS: [f64; 7] = [1.25, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0];
const CLASSES: [&str; 8] = ["h0", "h1", "h2", "h3", "h4", "h5", "h6", "h7"];
/// Cycles side by side; more go below.
const ACROSS: usize = 16;

pub(crate) fn section(models: &[Stage]) -> String {
    let maps: Vec<String> = models.iter().map(map).collect();
    if maps.iter().all(String::is_empty) {
        return String::new();
    }
    format!(
        "<section class=\"heat\" id=\"heat\"><h2>Error by sensor and cycle</h2>\n<p class=\"key\" aria-hidden=\"true\">rms of model − measured, times the noise: {}</p>\n<div class=\"maps\">\n{}</div>\n</section>\n",
        key(),
        maps.concat()
    )
}

fn key() -> String {
    let ends: Vec<String> =
        LEVELS.iter().map(|l| significant(*l, if *l < 2.0 { 3 } else { 2 })).map(|l| l.replace(".0", "")).collect();
    let text = |i: usize| match i {
        0 => format!("≤ {}", ends[0]),
        7 => format!("&gt; {}", ends[6]),
        i => format!("– {}", ends[i]),
    };
    CLASSES.iter().enumerate().map(|(i, class)| format!(r#"<span class="cell {class}">{}</span>"#, text(i))).collect()
}

fn map(stage: &Stage) -> String {
    let rows = rows(stage.fit);
    let cycles: Vec<usize> = {
        let mut all: Vec<usize> = rows.iter().flat_map(|(_, cells)| cells.iter().map(|c| c.0)).collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    if cycles.is_empty() {
        return String::new();
    }
    let mut out = format!("<figure class=\"map\"><figcaption>{}</figcaption>\n", escape(&stage.title));
    for part in cycles.chunks(ACROSS) {
        let columns: Vec<String> = part.iter().map(|c| c.to_string()).collect();
        let cells: Vec<(String, Vec<Cell>)> = rows
            .iter()
            .map(|(name, known)| {
                let of = |cycle: &usize| known.iter().find(|(c, _)| c == cycle).map(|(_, times)| cell(*times));
                (name.clone(), part.iter().map(of).collect())
            })
            .collect();
        let caption = format!("{}: rms of model − measured in each cycle, in units of the noise", stage.title);
        out.push_str(&matrix(&caption, "cycle", &columns, &cells));
    }
    out.push_str("</figure>\n");
    out
}

/// Each sensor of each run, with the rms in each cycle over its noise.
fn rows(fit: &Fit) -> Vec<(String, Vec<(usize, f64)>)> {
    let name = |file: &str, sensor: &SensorFit| match fit.runs.len() {
        1 => sensor.name.clone(),
        _ => format!("{} · {file}", sensor.name),
    };
    let sensors = fit.runs.iter().flat_map(|r| r.sensors.iter().map(move |s| (r, s)));
    sensors.map(|(run, sensor)| (name(&run.file, sensor), over_noise(sensor))).collect()
}

fn over_noise(sensor: &SensorFit) -> Vec<(usize, f64)> {
    by_cycle(sensor).into_iter().map(|c| (c.cycle, c.rms_m / sensor.noise_m)).collect()
}

fn cell(times: f64) -> (&'static str, String) {
    if !times.is_finite() {
        return ("", "–".into());
    }
    let level = LEVELS.iter().position(|l| times <= *l).unwrap_or(LEVELS.len());
    (CLASSES[level], if times < 9.95 { format!("{times:.1}") } else { format!("{times:.0}") })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::problem::compare::ExtremumError;

    /// Two cycles of 1 s: in the first the model is 0.3 m off, in the second 0.03 m, with a noise of 0.03 m.
    fn sensor() -> SensorFit {
        let time_s: Vec<f64> = (0..2000).map(|i| f64::from(i) * 1e-3).collect();
        let off = |t: f64| if t < 1.0 { 0.3 } else { 0.03 };
        let peak = |cycle: usize| ExtremumError {
            cycle,
            peak: true,
            time_s: cycle as f64 - 0.5,
            measured_m: 1.0,
            model_m: 1.0,
            phase_s: 0.0,
        };
        SensorFit {
            name: "P<1>".into(),
            position_m: 1.0,
            measured_m: vec![5.0; 2000],
            model_m: time_s.iter().map(|&t| 5.0 - off(t)).collect(),
            band_m: Vec::new(),
            noise_m: 0.03,
            white_noise_m: 0.03,
            rmse_m: 0.2,
            start_rmse_m: 1.0,
            before_m: None,
            extrema: vec![peak(1), peak(2)],
            time_s,
        }
    }

    #[test]
    fn each_cycle_shows_its_error_over_the_noise() {
        let cycles = over_noise(&sensor());
        assert_eq!(cycles.iter().map(|c| c.0).collect::<Vec<_>>(), [1, 2]);
        assert!((cycles[0].1 - 10.0).abs() < 1e-9 && (cycles[1].1 - 1.0).abs() < 1e-9, "{cycles:?}");
        assert_eq!(cell(cycles[0].1), ("h4", "10".into()));
        assert_eq!(cell(cycles[1].1), ("h0", "1.0".into()));
    }

    #[test]
    fn a_map_has_a_cell_a_sensor_and_cycle() {
        let mut many = sensor();
        many.extrema = (1..=20)
            .map(|cycle| ExtremumError { cycle, time_s: 0.1 * cycle as f64 - 0.05, ..many.extrema[0] })
            .collect();
        let run = crate::fit::outcome::fit::RunFit {
            file: "a".into(),
            rmse_m: 0.2,
            noise_m: 0.03,
            mape_extrema_percent: 0.0,
            noise_dies_away: false,
            meter_flow_m3_s: None,
            sensors: vec![many, sensor()],
        };
        let fit = Fit {
            effects: vec![],
            runs: vec![run],
            parameters: vec![],
            correlation: vec![],
            unidentifiable: vec![],
            reaches: 1,
            grid_error_m: 0.0,
            evaluations: 1,
            seconds: 1.0,
            steps: vec![],
            stopped_because: String::new(),
            converged: true,
            cost: 0.0,
            predicted_reduction: 0.0,
            posterior: None,
            features_left: vec![],
            method: crate::fit::problem::method::Method::default(),
        };
        let map = map(&Stage { title: "base & co".into(), fit: &fit });
        assert_eq!(map.matches("<td class=\"cell").count(), 20 + 2);
        assert_eq!(map.matches("<table").count(), 2, "twenty cycles stand in two rows of at most sixteen");
        assert!(map.contains("P&lt;1&gt;") && map.contains("base &amp; co") && !map.contains("NaN"));
    }

    #[test]
    fn colours_follow_the_levels() {
        assert_eq!([0.9, 1.25, 1.3, 64.0, 64.1].map(|t| cell(t).0), ["h0", "h0", "h1", "h6", "h7"]);
        assert_eq!(cell(f64::NAN), ("", "–".into()));
        assert!(key().contains("≤ 1.25") && key().contains("– 2<") && key().contains("&gt; 64"), "{}", key());
    }
}
