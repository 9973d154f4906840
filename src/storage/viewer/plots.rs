//! Which curves of a recording belong into one plot.

use serde::Serialize;

use crate::rig::{Rig, Sensor, SensorKind, Upstream};
use crate::storage::schema::{Kind, Shows};

/// Curves that share an axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plot {
    /// Quantity and unit.
    pub title: String,
    /// Its curves.
    pub curves: Vec<Curve>,
}

/// The field `value` of a channel's messages over time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Topic of the channel.
    pub topic: String,
    /// Name in the legend.
    pub label: String,
}

/// The only field that is plotted.
pub(crate) const FIELD: &str = "value";

/// The plots of a rig's sensors: one a quantity and unit, pressure first, in the rig's order.
pub fn plots(rig: &Rig, with_model: bool) -> Vec<Plot> {
    let mut plots = Vec::new();
    let (pressures, others): (Vec<&Sensor>, Vec<&Sensor>) =
        rig.sensors.iter().partition(|s| s.kind == SensorKind::Pressure);
    let modelled = |sensor: &Sensor| with_model && !(rig.upstream == Upstream::Measured && sensor.position_m == 0.0);
    for sensor in &pressures {
        add(&mut plots, "Pressure", sensor, Kind::Sample.topic(&sensor.name), sensor.name.clone());
        if modelled(sensor) {
            add(&mut plots, "Pressure", sensor, Shows::Model.topic(&sensor.name), format!("{}, model", sensor.name));
        }
    }
    for sensor in pressures.iter().filter(|s| modelled(s)) {
        let label = format!("{}, measured − model", sensor.name);
        add(&mut plots, "Residual", sensor, Shows::Residual.topic(&sensor.name), label);
    }
    for sensor in others {
        add(&mut plots, quantity(sensor.kind), sensor, Kind::Sample.topic(&sensor.name), sensor.name.clone());
    }
    plots
}

fn add(plots: &mut Vec<Plot>, quantity: &str, sensor: &Sensor, topic: String, label: String) {
    let title = match sensor.unit.symbol {
        "1" => quantity.to_owned(),
        unit => format!("{quantity}, {unit}"),
    };
    let curve = Curve { topic, label };
    match plots.iter_mut().find(|plot| plot.title == title) {
        Some(plot) => plot.curves.push(curve),
        None => plots.push(Plot { title, curves: vec![curve] }),
    }
}

fn quantity(kind: SensorKind) -> &'static str {
    match kind {
        SensorKind::Pressure => "Pressure",
        SensorKind::Flow => "Flow",
        SensorKind::Temperature => "Temperature",
        SensorKind::ValvePosition => "Valve position",
        SensorKind::Trigger => "Trigger",
    }
}
