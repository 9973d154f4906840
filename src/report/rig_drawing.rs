//! A rig in plan, the way from its supply to its valve as a line: for the terminal, and as SVG.

use std::fmt::Write as _;

use crate::extent::ends;
use crate::report::rig_plan::{Plan, Point};
use crate::report::text::escape::escape;
use crate::rig::{NodeKind, Opening, Place, Rig, Sensor, SensorKind, Upstream};

/// Columns of the pipe in the terminal.
const COLUMNS: usize = 68;
/// The SVG: size of the picture, and where the pipe begins and ends, px.
const WIDTH: f64 = 960.0;
const FROM: f64 = 90.0;
const TO: f64 = 870.0;
/// Height of the way where the rig is level and nothing lies above it, and px that the highest rise may take.
const AXIS: f64 = 150.0;
const RISE: f64 = 60.0;
/// Width of the thinnest and the widest pipe, px.
const PIPE: [f64; 2] = [6.0, 16.0];
/// Half the size of what is at a node, px.
const HALF: f64 = 15.0;

/// The rig in a few lines of text: the way from the supply to the valve, then each line beside it.
pub fn text(rig: &Rig) -> String {
    let graph = &rig.graph;
    let way: Vec<usize> = graph.way.iter().map(|(line, _)| *line).collect();
    let on_way = rig.sensors.iter().filter(|s| way.contains(&s.line)).map(|s| (rig.on_way_m(s.place()), s)).collect();
    let joints = rig.way_pipes().scan(0.0, |at_m, p| {
        *at_m += p.length_m;
        Some(*at_m)
    });
    let mut out =
        track(rig, [&name(rig, graph.supply()), &name(rig, graph.valve)], ["[", "]X"], rig.length_m(), joints, on_way);
    for (k, line) in graph.lines.iter().enumerate().filter(|(k, _)| !way.contains(k)) {
        let own = rig.sensors.iter().filter(|s| s.line == k).map(|s| (s.position_m, s)).collect();
        let ends = [name(rig, line.from), name(rig, line.to)];
        out += "\n";
        out += &track(rig, [&ends[0], &ends[1]], ["+", "+"], rig.line_length_m(k), std::iter::empty(), own);
    }
    for pipe in 0..rig.pipes.len() {
        let _ = writeln!(out, "{}", pipe_words(rig, pipe));
    }
    out
}

/// One line of pipes between two names, with its sensors below.
fn track(
    rig: &Rig,
    [start, end]: [&str; 2],
    [first, last]: [&str; 2],
    length_m: f64,
    joints_m: impl Iterator<Item = f64>,
    mut sensors: Vec<(f64, &Sensor)>,
) -> String {
    let column = |m: f64| ((m / length_m) * (COLUMNS - 1) as f64).round() as usize;
    let mut pipe = vec!['='; COLUMNS];
    joints_m.map(column).filter(|&at| at + 1 < COLUMNS).for_each(|at| pipe[at] = '+');
    sensors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut rows: Vec<String> = Vec::new();
    let mut feet = vec![' '; COLUMNS];
    for (at_m, sensor) in sensors {
        let at = column(at_m);
        feet[at] = '|';
        let label = label_in(rig, sensor);
        let from = at.min(COLUMNS.saturating_sub(label.chars().count()));
        let free = rows.iter_mut().find(|row| row.chars().count() < from || row.is_empty());
        match free {
            Some(row) => *row = format!("{row:<from$}{label}"),
            None => rows.push(format!("{:<from$}{label}", "")),
        }
    }
    let wide = COLUMNS + 2;
    let mut out = format!("{start:<12}{end:>0$}\n", wide - 12.max(start.chars().count()).min(wide));
    let _ = writeln!(out, "{first}{}{last}", pipe.iter().collect::<String>());
    let feet: String = feet.iter().collect();
    if !feet.trim().is_empty() {
        let _ = writeln!(out, " {}", feet.trim_end());
    }
    for row in rows {
        let _ = writeln!(out, " {row}");
    }
    out
}

/// The rig as a picture of its own.
pub fn svg(rig: &Rig) -> String {
    let (graph, plan) = (&rig.graph, Plan::of(rig));
    let heights: Vec<f64> = rig.pipes.iter().flat_map(|p| [p.elevation_start_m, p.elevation_end_m]).collect();
    let (low, high) = ends(&heights);
    // Heights are drawn where nothing branches.
    let rises = high > low && graph.lines.len() == 1;
    let [above, below] = plan.heights().map(|share| share * (TO - FROM));
    let drawn = |[x, y]: Point| [FROM + (TO - FROM) * x, AXIS - above + (TO - FROM) * y];
    let at = |place: Place| {
        let [x, y] = drawn(plan.at(rig, place));
        [x, y - if rises { RISE * ((rig.elevation_m(place) - low) / (high - low) - 0.5) } else { 0.0 }]
    };
    let bottom = AXIS - above + below + RISE / 2.0 + 54.0;
    let sensors = levels(rig, &at);
    let labels = sensors.iter().map(|(_, _, level)| level + 1).max().unwrap_or(0) as f64 * 20.0;
    let height = bottom + labels + 24.0 * rig.pipes.len() as f64 + 40.0;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height:.0}\" width=\"{WIDTH}\" height=\"{height:.0}\" \
         font-family=\"sans-serif\" font-size=\"13\" role=\"img\"><title>Rig {name}</title>\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/><text x=\"{FROM}\" y=\"34\" font-size=\"18\" font-weight=\"600\">{name}</text>",
        name = escape(&rig.name)
    );
    for ([x, y], _, level) in &sensors {
        let label_y = bottom + 20.0 * *level as f64;
        let _ = write!(out, "<line x1=\"{x:.1}\" y1=\"{y:.1}\" x2=\"{x:.1}\" y2=\"{label_y:.1}\" stroke=\"#999\"/>");
    }
    let widest = rig.pipes.iter().map(|p| p.inner_diameter_m).fold(0.0, f64::max);
    for (k, line) in graph.lines.iter().enumerate() {
        let mut from_m = 0.0;
        for i in line.pipes.clone() {
            let p = &rig.pipes[i];
            let to_m = from_m + p.length_m;
            let mut corners = vec![at(Place { line: k, position_m: from_m }), at(Place { line: k, position_m: to_m })];
            if line.pipes.len() == 1 && !rises {
                corners = plan.lines[k].iter().copied().map(drawn).collect();
            }
            let points: Vec<String> = corners.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
            let width = (PIPE[1] * p.inner_diameter_m / widest).max(PIPE[0]);
            let _ = write!(
                out,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"#7aa6d6\" stroke-width=\"{width:.1}\" stroke-linejoin=\"round\"><title>{}</title></polyline>",
                points.join(" "),
                escape(&pipe_words(rig, i))
            );
            from_m = to_m;
        }
    }
    for (n, node) in graph.nodes.iter().enumerate() {
        let own = graph.lines.iter().enumerate().find(|(_, line)| line.from == n || line.to == n);
        let Some((k, line)) = own else { continue };
        let end = at(Place { line: k, position_m: if line.from == n { 0.0 } else { rig.line_length_m(k) } });
        // Beyond the end of a single pipe, which it would hide.
        let outward = plan.outward(graph, n).filter(|_| !matches!(node.kind, NodeKind::Junction { .. }));
        let outward = outward.unwrap_or_default();
        let begins = graph.lines.iter().position(|line| line.from == n);
        let towards =
            begins.and_then(|k| plan.lines[k].get(1)).map_or(1.0, |next| (next[0] - plan.nodes[n][0]).signum());
        let _ = write!(out, "{}", mark(rig, n, [0, 1].map(|i| end[i] + HALF * outward[i]), towards));
    }
    for ([x, y], sensor, level) in sensors {
        let label_y = bottom + 20.0 * level as f64;
        let (anchor, aside) = if x > WIDTH / 2.0 { ("end", -6.0) } else { ("start", 6.0) };
        let _ = write!(
            out,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\" fill=\"{}\" stroke=\"#fff\"/>\
             <text x=\"{:.1}\" y=\"{label_y:.1}\" text-anchor=\"{anchor}\">{}</text>",
            colour(sensor.kind),
            x + aside,
            escape(&label_in(rig, sensor))
        );
    }
    for i in 0..rig.pipes.len() {
        let _ = write!(
            out,
            "<text x=\"{FROM}\" y=\"{:.1}\" fill=\"#444\">{}</text>",
            bottom + labels + 24.0 * (i + 1) as f64,
            escape(&pipe_words(rig, i))
        );
    }
    out + "</svg>\n"
}

/// What is at a node, with its name; water passes to the right (1) or to the left (-1).
fn mark(rig: &Rig, n: usize, [x, y]: Point, towards: f64) -> String {
    let node = &rig.graph.nodes[n];
    let pump = matches!(node.kind, NodeKind::Pump(_)) || (n == rig.graph.supply() && rig.upstream == Upstream::Pump);
    let (water, line) = ("#dbeafe", "#1e3a5f");
    let triangles = |fill: &str| {
        let (left, top, size) = (x - HALF, y - HALF, 2.0 * HALF);
        format!("<path d=\"M{left:.1} {top:.1} l{size} {size} v-{size} l-{size} {size} z\" fill=\"{fill}\"/>")
    };
    let (shape, up) = match &node.kind {
        _ if pump => {
            (format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{HALF}\" fill=\"{water}\" stroke=\"{line}\"/>"), HALF)
        }
        NodeKind::Reservoir { .. } | NodeKind::Tank { .. } => {
            let (left, top) = (x - HALF, y - 2.0 * HALF);
            let [wide, high] = [2.0 * HALF, 3.0 * HALF];
            let shape = format!(
                "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{wide}\" height=\"{high}\" fill=\"{water}\" stroke=\"{line}\"/>"
            );
            (shape, 2.0 * HALF)
        }
        NodeKind::Valve | NodeKind::Opening(Opening { closing: Some(_), .. }) => (triangles("#c8500a"), HALF),
        NodeKind::Opening(_) => (triangles("#777"), HALF),
        NodeKind::CheckValve => {
            let (back, top, size) = (x - towards * HALF / 2.0, y - HALF, 2.0 * HALF);
            let shape =
                format!("<path d=\"M{back:.1} {top:.1} v{size} l{:.1} -{HALF} z\" fill=\"#777\"/>", towards * HALF);
            (shape, HALF)
        }
        _ => (format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{line}\"/>"), 6.0),
    };
    // Pipes may lead up from a junction.
    let (aside, anchor) = if matches!(node.kind, NodeKind::Junction { .. }) { (9.0, "start") } else { (0.0, "middle") };
    format!(
        "{shape}<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\">{}</text>",
        x + aside,
        y - up - 6.0,
        escape(&name(rig, n))
    )
}

/// Sensors at their points, each with the row of its label: no two in a row touch.
fn levels<'r>(rig: &'r Rig, at: &dyn Fn(Place) -> Point) -> Vec<(Point, &'r Sensor, usize)> {
    let mut sensors: Vec<(Point, &Sensor)> = rig.sensors.iter().map(|s| (at(s.place()), s)).collect();
    sensors.sort_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    let mut taken: Vec<Vec<[f64; 2]>> = Vec::new();
    let place = |(point, sensor): (Point, &'r Sensor)| {
        let (x, width) = (point[0], 8.0 * label_in(rig, sensor).chars().count() as f64);
        let span = if x > WIDTH / 2.0 { [x - width, x] } else { [x, x + width] };
        let free = |row: &Vec<[f64; 2]>| row.iter().all(|[a, b]| span[1] < *a || span[0] > *b);
        let level = taken.iter().position(free).unwrap_or(taken.len());
        if level == taken.len() {
            taken.push(Vec::new());
        }
        taken[level].push(span);
        (point, sensor, level)
    };
    sensors.into_iter().map(place).collect()
}

/// A sensor with its place along its line.
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

/// The same; in a network with the name of the pipe.
fn label_in(rig: &Rig, sensor: &Sensor) -> String {
    match &rig.pipes_of(sensor.line)[0].name {
        pipe if rig.graph.lines.len() > 1 => format!("{} on {pipe}", label(sensor)),
        _ => label(sensor),
    }
}

fn colour(kind: SensorKind) -> &'static str {
    match kind {
        SensorKind::Pressure => "#0072b2",
        SensorKind::Flow => "#00805d",
        SensorKind::Temperature => "#a8438a",
        SensorKind::ValvePosition | SensorKind::Trigger => "#8a6500",
    }
}

/// What a drawing calls a node; the supply of pipes in series by what it is.
fn name(rig: &Rig, node: usize) -> String {
    match rig.upstream {
        _ if rig.graph.lines.len() > 1 || node != rig.graph.supply() => rig.graph.nodes[node].name.clone(),
        Upstream::Reservoir => "reservoir".to_owned(),
        Upstream::Pump => "pump".to_owned(),
        Upstream::Measured => "measured".to_owned(),
    }
}

fn pipe_words(rig: &Rig, pipe: usize) -> String {
    let p = &rig.pipes[pipe];
    let line = rig.graph.lines.iter().find(|line| line.pipes.contains(&pipe)).filter(|_| rig.graph.lines.len() > 1);
    let ends = line.map_or(String::new(), |line| format!(", from {} to {}", name(rig, line.from), name(rig, line.to)));
    format!(
        "{}: {} m of {}, inner diameter {:.1} mm, wall {:.1} mm{ends}",
        p.name,
        (100.0 * p.length_m).round() / 100.0,
        p.material,
        1e3 * p.inner_diameter_m,
        1e3 * p.wall_thickness_m
    )
}
