//! What one sensor in one run shows under all stages.

use crate::fit::outcome::fit::SensorFit;
use crate::report::view::curves::{BUCKETS, Curves};
use crate::report::{Overlay, Page};
use crate::rig::Rig;
use crate::units::GRAVITY_M_S2;

/// What one sensor in one run shows.
pub(crate) struct Panel<'a> {
    /// The last stage's fit of it, whose numbers the text gives.
    pub(crate) fit: &'a SensorFit,
    pub(crate) file: &'a str,
    pub(crate) curves: Curves,
    pub(crate) overlays: Vec<&'a Overlay>,
    /// The unit that the sensor shows, where that is not m of head above the datum.
    pub(crate) unit: Option<OwnUnit>,
}

/// How a sensor shows a head: `per_m` × head + `zero`.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct OwnUnit {
    pub(crate) symbol: &'static str,
    pub(crate) per_m: f64,
    pub(crate) zero: f64,
}

impl OwnUnit {
    /// The unit of a sensor of the rig, in water of a temperature.
    pub(crate) fn of(rig: &Rig, sensor: &str, temperature_degc: f64) -> Option<Self> {
        let sensor = rig.sensors.iter().find(|s| s.name == sensor)?;
        let density = rig.fluid.properties(temperature_degc).density_kg_m3;
        let shown = |head_m: f64| {
            sensor.unit.from_si((head_m - rig.sensor_elevation_m(sensor)) * density * GRAVITY_M_S2, density)
        };
        let (zero, per_m) = (shown(0.0), shown(1.0) - shown(0.0));
        let differs = (per_m - 1.0).abs() > 1e-9 || zero.abs() > 1e-9;
        (differs && per_m.is_finite() && zero.is_finite()).then_some(Self { symbol: sensor.unit.symbol, per_m, zero })
    }
}

/// A panel for each sensor of each run of the last stage.
pub(crate) fn panels<'a>(page: &'a Page) -> Vec<Panel<'a>> {
    let (stages, overlays) = (&page.stages, &page.overlays);
    let Some(last) = stages.last() else { return Vec::new() };
    let mut panels = Vec::new();
    for run in &last.fit.runs {
        for fit in &run.sensors {
            let Some(curves) = Curves::of(stages, &run.file, &fit.name, BUCKETS) else { continue };
            panels.push(Panel {
                fit,
                file: &run.file,
                unit: OwnUnit::of(page.rig, &fit.name, page.temperature_degc(&run.file)),
                curves,
                overlays: overlays.iter().filter(|o| o.sensor == fit.name).collect(),
            });
        }
    }
    panels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_head_is_shown_as_its_sensor_shows_it() {
        let source = include_str!("../../../rigs/imperial-pe.toml");
        let mut rig = Rig::from_toml(source, "rig.toml").unwrap();
        let name = rig.sensors[0].name.clone();
        rig.sensors[0].unit = "bar".parse().unwrap();
        rig.sensors[0].elevation_m = Some(10.0);
        let unit = OwnUnit::of(&rig, &name, 20.0).unwrap();
        let shown = |head_m: f64| unit.per_m * head_m + unit.zero;
        // 20 m of water of 998.2 kg/m3 above the sensor
        assert!(shown(10.0).abs() < 1e-9 && (shown(30.0) - 1.9585).abs() < 1e-3, "{}", shown(30.0));
        rig.sensors[0].unit = "m(H2O)".parse().unwrap();
        rig.sensors[0].elevation_m = Some(0.0);
        assert_eq!(OwnUnit::of(&rig, &name, 20.0), None, "that is the head itself");
    }
}
