//! The rig in short.

use std::fmt::Write as _;

use crate::report::html::page::{minus, table};
use crate::report::rig_drawing;
use crate::report::text::escape::escape;
use crate::report::text::number::{fixed, significant};
use crate::rig::{Constraint, Rig, SensorKind, Upstream};

pub(crate) fn section(rig: &Rig) -> String {
    let branches = rig.graph.lines.len() > 1;
    let supply = match rig.upstream {
        _ if branches => escape(&rig.graph.nodes[rig.graph.supply()].name),
        Upstream::Reservoir => "reservoir".into(),
        Upstream::Pump => "pump".into(),
        Upstream::Measured => "measured pressure at position 0".into(),
    };
    let mut out = format!(
        "<section id=\"rig\"><h2>Rig</h2>\n<dl><div><dt>name</dt><dd>{}</dd></div><div><dt>fluid</dt><dd>{}, {} °C</dd></div><div><dt>length</dt><dd>{} m{}</dd></div><div><dt>supply</dt><dd>{supply}</dd></div><div><dt>valve</dt><dd>closes in {} s (nominal)</dd></div></dl>\n",
        escape(&rig.name),
        escape(&rig.fluid.name),
        minus(&fixed(rig.fluid.temperature_degc, 1)),
        fixed(rig.length_m(), 2),
        if branches { " from the supply to the valve" } else { "" },
        significant(rig.valve.closing_time_s, 3),
    );
    let _ = writeln!(out, "<figure class=\"drawn\">{}</figure>", rig_drawing::svg(rig));
    let pipes = rig.pipes.iter().map(|p| {
        vec![
            escape(&p.name),
            escape(&p.material),
            match p.constraint {
                Constraint::Free => "free".into(),
                Constraint::AnchoredUpstream => "anchored upstream".into(),
                Constraint::Anchored => "anchored".into(),
                Constraint::Coefficient(c) => format!("c₁ = {}", significant(c, 3)),
            },
            fixed(p.length_m, 2),
            fixed(p.inner_diameter_m * 1e3, 2),
            fixed(p.wall_thickness_m * 1e3, 2),
            p.wave_speed_m_s.map_or("–".into(), |a| significant(a, 4)),
        ]
    });
    let headings =
        ["pipe", "material", "held", "length, m", "inner diameter, mm", "wall, mm", "nominal wave speed, m/s"];
    out.push_str(&table("Pipes", &headings, &[3, 4, 5, 6], pipes));
    let sensors = rig.sensors.iter().map(|s| {
        vec![
            escape(&s.name),
            match s.kind {
                SensorKind::Pressure => "pressure",
                SensorKind::Flow => "flow",
                SensorKind::Temperature => "temperature",
                SensorKind::ValvePosition => "valve position",
                SensorKind::Trigger => "trigger",
            }
            .into(),
            escape(s.unit.symbol),
            fixed(s.position_m, 2)
                + &if branches { format!(" {}", escape(&rig.along_words(s.line))) } else { String::new() },
            s.range.map_or("–".into(), |[lo, hi]| minus(&format!("{lo} to {hi}"))),
            s.accuracy_percent_fs.map_or("–".into(), |a| significant(a, 2)),
        ]
    });
    if !rig.sensors.is_empty() {
        let headings = ["sensor", "measures", "unit", "position, m", "range", "accuracy, % of full scale"];
        out.push_str(&table("Sensors", &headings, &[3, 4, 5], sensors));
    }
    if !rig.source.trim().is_empty() {
        out.push_str(&format!("<details><summary>Rig file</summary><pre>{}</pre></details>\n", escape(&rig.source)));
    }
    out.push_str("</section>\n");
    out
}
