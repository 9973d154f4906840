//! A rig from the supply to the valve, to scale: for the terminal, and as SVG.

use std::fmt::Write as _;

use crate::report::text::escape::escape;
use crate::rig::{Rig, Sensor, SensorKind, Upstream};

/// Columns of the pipe in the terminal.
const COLUMNS: usize = 68;
/// The SVG: size of the picture, and where the pipe begins and ends, px.
const WIDTH: f64 = 960.0;
const FROM: f64 = 90.0;
const TO: f64 = 870.0;
/// Height of the pipe's axis where the rig is level, and px that the highest rise may take.
const AXIS: f64 = 150.0;
const RISE: f64 = 60.0;
/// Width of the thinnest and the widest pipe, px.
const PIPE: [f64; 2] = [6.0, 16.0];

/// The rig in a few lines of text.
pub fn text(rig: &Rig) -> String {
    let length_m = rig.length_m();
    let column = |m: f64| ((m / length_m) * (COLUMNS - 1) as f64).round() as usize;
    let mut pipe = vec!['='; COLUMNS];
    let mut at_m = 0.0;
    for p in &rig.pipes[..rig.pipes.len() - 1] {
        at_m += p.length_m;
        pipe[column(at_m)] = '+';
    }
    let mut shown: Vec<&Sensor> = rig.sensors.iter().collect();
    shown.sort_by(|a, b| a.position_m.total_cmp(&b.position_m));
    let mut rows: Vec<String> = Vec::new();
    let mut feet = vec![' '; COLUMNS];
    for sensor in shown {
        let at = column(sensor.position_m);
        feet[at] = '|';
        let label = label(sensor);
        let from = at.min(COLUMNS.saturating_sub(label.chars().count()));
        let free = rows.iter_mut().find(|row| row.chars().count() < from || row.is_empty());
        match free {
            Some(row) => *row = format!("{row:<from$}{label}"),
            None => rows.push(format!("{:<from$}{label}", "")),
        }
    }
    let supply = supply_word(rig);
    let mut out = format!("{supply:<12}{}valve\n", " ".repeat(COLUMNS - 12 + 2));
    let _ = writeln!(out, "[{}]X", pipe.iter().collect::<String>());
    let _ = writeln!(out, " {}", feet.iter().collect::<String>().trim_end());
    for row in rows {
        let _ = writeln!(out, " {row}");
    }
    for p in &rig.pipes {
        let _ = writeln!(out, "{}", pipe_words(p));
    }
    out
}

/// The rig as a picture of its own.
pub fn svg(rig: &Rig) -> String {
    let length_m = rig.length_m();
    let x = |m: f64| FROM + (TO - FROM) * m / length_m;
    let heights: Vec<f64> = rig.pipes.iter().flat_map(|p| [p.elevation_start_m, p.elevation_end_m]).collect();
    let (low, high) = heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &h| (a.min(h), b.max(h)));
    let y = |m: f64| AXIS - if high > low { RISE * ((rig.elevation_m(m) - low) / (high - low) - 0.5) } else { 0.0 };
    let widest = rig.pipes.iter().map(|p| p.inner_diameter_m).fold(0.0, f64::max);
    let levels = levels(rig, &x);
    let bottom = AXIS + RISE / 2.0 + 54.0;
    let below = levels.iter().map(|(_, level)| level + 1).max().unwrap_or(0) as f64 * 20.0;
    let height = bottom + below + 24.0 * rig.pipes.len() as f64 + 40.0;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height:.0}\" width=\"{WIDTH}\" height=\"{height:.0}\" \
         font-family=\"sans-serif\" font-size=\"13\" role=\"img\"><title>Rig {name}</title>\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/><text x=\"{FROM}\" y=\"34\" font-size=\"18\" font-weight=\"600\">{name}</text>",
        name = escape(&rig.name)
    );
    // The supply: a tank, or a pump.
    let (x0, y0) = (x(0.0), y(0.0));
    match rig.upstream {
        Upstream::Pump => {
            let _ = write!(
                out,
                "<circle cx=\"{:.1}\" cy=\"{y0:.1}\" r=\"18\" fill=\"#dbeafe\" stroke=\"#1e3a5f\"/>",
                x0 - 18.0
            );
        }
        Upstream::Reservoir | Upstream::Measured => {
            let _ = write!(
                out,
                "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"44\" height=\"66\" fill=\"#dbeafe\" stroke=\"#1e3a5f\"/>",
                x0 - 44.0,
                y0 - 56.0
            );
        }
    }
    let _ = write!(out, "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>", x0, y0 - 64.0, supply_word(rig));
    let mut from_m = 0.0;
    for p in &rig.pipes {
        let to_m = from_m + p.length_m;
        let width = (PIPE[1] * p.inner_diameter_m / widest).max(PIPE[0]);
        let _ = write!(
            out,
            "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"#7aa6d6\" stroke-width=\"{width:.1}\"><title>{}</title></line>",
            x(from_m),
            y(from_m),
            x(to_m),
            y(to_m),
            escape(&pipe_words(p))
        );
        from_m = to_m;
    }
    // The valve: two triangles.
    let (x1, y1) = (x(length_m), y(length_m));
    let _ = write!(
        out,
        "<path d=\"M{x1:.1} {:.1} l28 28 v-28 l-28 28 z\" fill=\"#c8500a\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">valve</text>",
        y1 - 14.0,
        x1 + 14.0,
        y1 - 22.0
    );
    for (sensor, level) in levels {
        let (sx, sy) = (x(sensor.position_m), y(sensor.position_m));
        let label_y = bottom + 20.0 * level as f64;
        let anchor = if sx > WIDTH / 2.0 { "end" } else { "start" };
        let aside = if sx > WIDTH / 2.0 { -6.0 } else { 6.0 };
        let _ = write!(
            out,
            "<line x1=\"{sx:.1}\" y1=\"{sy:.1}\" x2=\"{sx:.1}\" y2=\"{label_y:.1}\" stroke=\"#555\" stroke-width=\"1\"/>\
             <circle cx=\"{sx:.1}\" cy=\"{sy:.1}\" r=\"5\" fill=\"{}\" stroke=\"#fff\"/>\
             <text x=\"{:.1}\" y=\"{label_y:.1}\" text-anchor=\"{anchor}\">{}</text>",
            colour(sensor.kind),
            sx + aside,
            escape(&label(sensor))
        );
    }
    for (i, p) in rig.pipes.iter().enumerate() {
        let _ = write!(
            out,
            "<text x=\"{FROM}\" y=\"{:.1}\" fill=\"#444\">{}</text>",
            bottom + below + 24.0 * (i + 1) as f64,
            escape(&pipe_words(p))
        );
    }
    out + "</svg>\n"
}

/// Sensors along the pipe, each with the row of its label: no two in a row touch.
fn levels<'r>(rig: &'r Rig, x: &dyn Fn(f64) -> f64) -> Vec<(&'r Sensor, usize)> {
    let mut sensors: Vec<&Sensor> = rig.sensors.iter().collect();
    sensors.sort_by(|a, b| a.position_m.total_cmp(&b.position_m));
    let mut taken: Vec<Vec<[f64; 2]>> = Vec::new();
    let place = |sensor: &'r Sensor| {
        let (at, width) = (x(sensor.position_m), 8.0 * label(sensor).chars().count() as f64);
        let span = if at > WIDTH / 2.0 { [at - width, at] } else { [at, at + width] };
        let free = |row: &Vec<[f64; 2]>| row.iter().all(|[a, b]| span[1] < *a || span[0] > *b);
        let level = taken.iter().position(free).unwrap_or(taken.len());
        if level == taken.len() {
            taken.push(Vec::new());
        }
        taken[level].push(span);
        (sensor, level)
    };
    sensors.into_iter().map(place).collect()
}

fn label(sensor: &Sensor) -> String {
    let what = match sensor.kind {
        SensorKind::Pressure => "",
        SensorKind::Flow => " flow",
        SensorKind::Temperature => " temperature",
        SensorKind::ValvePosition => " opening",
        SensorKind::Trigger => " trigger",
    };
    format!("{}{what} {:.1} m", sensor.name, sensor.position_m)
}

fn colour(kind: SensorKind) -> &'static str {
    match kind {
        SensorKind::Pressure => "#0072b2",
        SensorKind::Flow => "#00805d",
        SensorKind::Temperature => "#a8438a",
        SensorKind::ValvePosition | SensorKind::Trigger => "#8a6500",
    }
}

fn supply_word(rig: &Rig) -> &'static str {
    match rig.upstream {
        Upstream::Reservoir => "reservoir",
        Upstream::Pump => "pump",
        Upstream::Measured => "measured",
    }
}

fn pipe_words(p: &crate::rig::Pipe) -> String {
    format!(
        "{}: {} m of {}, inner diameter {:.1} mm, wall {:.1} mm",
        p.name,
        (100.0 * p.length_m).round() / 100.0,
        p.material,
        1e3 * p.inner_diameter_m,
        1e3 * p.wall_thickness_m
    )
}
