//! Checks the steady flow against the meter's range and against the friction between pressure sensors.

use crate::rig::check::{Finding, Level, check_meter, flow_regime, friction_loss_m};
use crate::rig::{CERTAINLY_LAMINAR_REYNOLDS, Rig, Sensor, WaterProperties};
use crate::signal::check::track::{Front, Track};

/// The steady flow: its regime, the meter's range, and the friction between pressure sensors that it implies.
pub(crate) fn check_flow(
    rig: &Rig,
    track: &Track<'_>,
    start_s: Option<f64>,
    fronts: &[Front<'_>],
    water: &WaterProperties,
) -> Vec<Finding> {
    let name = &track.sensor.name;
    let Some(shown) = track.mean_until(start_s) else { return Vec::new() };
    let flow = track.sensor.unit.to_si(shown, water.density_kg_m3);
    let mut findings: Vec<Finding> =
        check_meter(track.sensor, format!("range of '{name}'"), shown).into_iter().collect();
    for pipe in &rig.pipes {
        let reynolds = pipe.reynolds(water, flow);
        let velocity = flow / pipe.area_m2();
        let level =
            if (CERTAINLY_LAMINAR_REYNOLDS..4000.0).contains(&reynolds.abs()) { Level::Warning } else { Level::Fine };
        let message = format!("Re {reynolds:.0} at {velocity:.3} m/s, {}", flow_regime(reynolds));
        let numbers = [("reynolds_number", reynolds), ("velocity_m_s", velocity)];
        findings.push(Finding::new(level, format!("flow in '{}' by '{name}'", pipe.name), message, &numbers));
    }
    let mut heads: Vec<(&Sensor, f64, f64)> =
        fronts.iter().filter_map(|f| f.steady_head_m(rig, water).map(|(h, off)| (f.track.sensor, h, off))).collect();
    let on_way_m = |sensor: &Sensor| rig.on_way_m(sensor.place());
    heads.sort_by(|a, b| on_way_m(a.0).total_cmp(&on_way_m(b.0)));
    if let [first, .., last] = &heads[..] {
        findings.push(check_loss(rig, *first, *last, flow, water));
    }
    findings
}

fn check_loss(
    rig: &Rig,
    (up, up_m, up_off): (&Sensor, f64, f64),
    (down, down_m, down_off): (&Sensor, f64, f64),
    flow: f64,
    water: &WaterProperties,
) -> Finding {
    let measured = up_m - down_m;
    let expected = friction_loss_m(rig, rig.on_way_m(up.place()), rig.on_way_m(down.place()), flow, water);
    // a percent of the diameter makes five percent of the loss; bends and joints add to it
    let slack = up_off + down_off + 0.15 * expected.abs();
    let off = measured - expected;
    let subject = format!("steady loss from '{}' to '{}'", up.name, down.name);
    let compared = format!(
        "{measured:.2} m measured, {expected:.2} m by wall friction; the sensors and the pipe's data allow for ±{slack:.2} m"
    );
    let (level, message) = if off.abs() <= slack {
        (Level::Fine, compared)
    } else if off.abs() <= 3.0 * slack {
        (Level::Warning, format!("{compared}: look at offsets, elevations and roughness"))
    } else {
        (
            Level::Contradiction,
            format!(
                "{compared}: a zero or gain, an elevation, the flow or the diameter is wrong, or a local loss lies between them"
            ),
        )
    };
    let numbers = [("measured_m", measured), ("expected_m", expected), ("allowed_m", slack)];
    Finding::new(level, subject, message, &numbers)
}
