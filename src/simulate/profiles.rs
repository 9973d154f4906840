//! Velocity profiles and wall shear of a simulated run at one place, from the flow there.

use std::error::Error;

use crate::model::eddy_viscosity::EddyViscosity;
use crate::model::effects::unsteady_friction::SCALE_2D;
use crate::model::friction::WallFriction;
use crate::model::profile::Profile;
use crate::model::trace::Probe;
use crate::rig::{Place, Regime};
use crate::simulate::scenario::Scenario;
use crate::units::GRAVITY_M_S2;

/// The flow over a cross-section in time.
#[derive(Debug, Clone, PartialEq)]
pub struct Profiles {
    /// Where, m along the line to the valve.
    pub position_m: f64,
    /// Middle of each ring, m from the axis.
    pub radius_m: Vec<f64>,
    /// Moments in order.
    pub moments: Vec<Moment>,
}

/// The flow over a cross-section at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct Moment {
    /// After the start of the closure, s.
    pub time_s: f64,
    /// Mean velocity, m/s.
    pub mean_m_s: f64,
    /// Wall shear, Pa.
    pub shear_pa: f64,
    /// Wall shear of a steady flow of that mean, Pa.
    pub steady_shear_pa: f64,
    /// Velocity in each ring, m/s.
    pub velocity_m_s: Vec<f64>,
}

/// Profiles of a scenario in two dimensions at `position_m` along the line to the valve (beyond its end: there), at some times.
///
/// # Errors
/// A model without profiles, and as [`Scenario::probe`].
pub fn profiles(
    scenario: &Scenario,
    position_m: f64,
    duration_s: f64,
    times_s: impl IntoIterator<Item = f64>,
) -> Result<Profiles, Box<dyn Error + Send + Sync>> {
    let Some((_, scale)) = scenario.values().into_iter().find(|(name, _)| name == SCALE_2D) else {
        return Err("velocity profiles need option `solver quasi-2d`".into());
    };
    let (rig, water) = (&scenario.rig, &scenario.water);
    let line = rig.graph.line_to_valve();
    let mut end_m = 0.0;
    let pipe = rig.pipes_of(line).iter().find(|pipe| {
        end_m += pipe.length_m;
        position_m <= end_m
    });
    let pipe = pipe.unwrap_or(rig.pipe_at_valve());
    let trace = scenario.probe(&[Probe::flow(Place { line, position_m })], duration_s)?.remove(0);
    let before_m3_s = trace.at(0.0);
    let (diameter_m, viscosity_m2_s) = (pipe.inner_diameter_m, water.kinematic_viscosity_m2_s);
    let law = WallFriction::of(pipe, water, before_m3_s).scaled(scenario.run.friction_scale);
    let reynolds = pipe.reynolds(water, before_m3_s).abs();
    let viscosity = match Regime::of(reynolds) {
        Regime::Laminar => EddyViscosity::LAMINAR,
        Regime::Turbulent => {
            EddyViscosity::of_flow(reynolds, law.slope(diameter_m, before_m3_s).abs(), diameter_m, viscosity_m2_s)
        }
    };
    let by_diffusion = 4.0 * viscosity_m2_s / (diameter_m * diameter_m);
    let profile = Profile::new(viscosity, trace.dt_s * by_diffusion);
    let area_m2 = pipe.area_m2();
    let mut moving = profile.at_rest(before_m3_s / area_m2);
    let mut steps = 0;
    let moments = times_s.into_iter().map(|time_s| {
        while (steps + 1) as f64 * trace.dt_s <= time_s {
            steps += 1;
            moving.advance(trace.dt_s * by_diffusion, trace.at(steps as f64 * trace.dt_s) / area_m2);
        }
        // The rest of the way for this moment alone.
        let (mut moving, flow_m3_s) = (moving.clone(), trace.at(time_s));
        moving.advance((time_s - steps as f64 * trace.dt_s).max(0.0) * by_diffusion, flow_m3_s / area_m2);
        let steady_shear_pa = 0.25 * water.density_kg_m3 * GRAVITY_M_S2 * diameter_m * law.slope(diameter_m, flow_m3_s);
        let unsteady_pa = water.density_kg_m3 * viscosity_m2_s / diameter_m * moving.unsteady_shear_m_s();
        Moment {
            time_s,
            mean_m_s: flow_m3_s / area_m2,
            shear_pa: steady_shear_pa + scale * unsteady_pa,
            steady_shear_pa,
            velocity_m_s: moving.velocity_m_s(),
        }
    });
    let moments = moments.collect();
    let radius_m = profile.radii().iter().map(|r| 0.5 * diameter_m * r).collect();
    Ok(Profiles { position_m, radius_m, moments })
}
