//! The quasi-2D model against the exact laminar solution, Vardy and Brown's friction, and what must not change.

use super::exact::{Exact, Ramp, Shear};
use super::{cosine, orders, relative_rms, rig};
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, Resolution, RunValues};

const QUASI_2D: &str = "unsteady-friction/quasi-2d";
const VARDY_BROWN: &str = "unsteady-friction";
const LENGTH_M: f64 = 37.23;
const VISCOSITY_M2_S: f64 = 1.181818e-6;

/// Adelaide's copper pipe (Bergant et al. 2001): deviation of the head at the valve.
struct Case {
    velocity: f64,
    friction: &'static str,
    closing_s: f64,
    effects: &'static str,
    values: Vec<f64>,
}

impl Case {
    fn head(&self, reaches: usize, times: &[f64]) -> Vec<f64> {
        let rig = rig(LENGTH_M, 22.1, 2.0, self.friction);
        let mut water = rig.fluid.properties(20.0);
        (water.density_kg_m3, water.kinematic_viscosity_m2_s) = (1000.0, VISCOSITY_M2_S);
        let mut model = Model::new(&rig, &water, &parse_list(self.effects).unwrap());
        model.closure = cosine;
        let run = RunValues {
            initial_velocity_m_s: self.velocity,
            valve_head_m: 60.0,
            closing_time_s: self.closing_s,
            friction_scale: 1.0,
        };
        let shared = [&[1319.0], &self.values[..]].concat();
        let resolution = Resolution { reaches, duration_s: times.iter().copied().fold(0.0, f64::max) };
        let probes = [Probe::head(LENGTH_M)];
        let simulated = model.simulate(&Conditions::of(water), &shared, &run, resolution, &probes).unwrap();
        times.iter().map(|&t| simulated.traces[0].at(t) - 60.0).collect()
    }
}

fn laminar() -> Case {
    Case { velocity: 0.05, friction: "", closing_s: 0.009, effects: QUASI_2D, values: vec![1.0] }
}

fn exact(creep: Vec<(f64, f64)>, closing_s: f64) -> Exact {
    Exact {
        length: LENGTH_M,
        diameter: 0.0221,
        wall: 0.002,
        wave_speed: 1319.0,
        density: 1000.0,
        velocity: 0.05,
        ramp: Ramp::Cosine(closing_s),
        creep,
        shear: Shear::Laminar { viscosity: VISCOSITY_M2_S },
    }
}

fn times(count: u32, step: f64) -> Vec<f64> {
    (0..count).map(|i| f64::from(i) * step).collect()
}

/// Relative rms at the valve over 13 periods. The rings grow finer with the step, as `√Δt`.
#[test]
fn laminar_heads_converge_to_the_exact_ones() {
    let times = times(3000, 5e-4);
    let head = exact(vec![], 0.009).head(LENGTH_M, &times);
    let errors = [60, 120, 240, 480].map(|n| relative_rms(&laminar().head(n, &times), &head));
    println!("laminar quasi-2D, relative rms at 60, 120, 240, 480 reaches: {errors:?}, orders {:?}", orders(&errors));
    assert!(errors[2] <= 2e-3 && errors[3] <= 1e-3, "{errors:?}");
    assert!(errors.windows(2).all(|w| w[1] < w[0]), "{errors:?}");
}

#[test]
fn with_creep_it_is_exact_too() {
    let times = times(1000, 1e-3);
    let head = exact(vec![(5e-12, 0.02), (5e-12, 0.2)], 0.02).head(LENGTH_M, &times);
    let case = Case {
        closing_s: 0.02,
        effects: "unsteady-friction/quasi-2d,viscoelastic-wall:2",
        values: vec![1.0, 5e-3, 0.02, 5e-3, 0.2],
        ..laminar()
    };
    let error = relative_rms(&case.head(240, &times), &head);
    println!("laminar quasi-2D with creep: {error:e}");
    assert!(error < 2e-3, "{error}");
}

/// At the same Reynolds number Vardy and Brown's friction is nearer than quasi-steady friction.
#[test]
fn turbulent_heads_are_near_vardy_and_browns() {
    let times = times(3000, 5e-4);
    for reynolds in [5e3, 1e4, 1e5, 1e6] {
        let case = |effects, values: &[f64]| Case {
            velocity: reynolds * VISCOSITY_M2_S / 0.0221,
            effects,
            values: values.to_vec(),
            ..laminar()
        };
        let own = case(QUASI_2D, &[1.0]).head(240, &times);
        let near = relative_rms(&case(VARDY_BROWN, &[1.0]).head(240, &times), &own);
        let far = relative_rms(&case("none", &[]).head(240, &times), &own);
        println!("Re {reynolds:e}: Vardy & Brown off by {near:.4}, quasi-steady friction by {far:.4}");
        // Their viscosity rises from the wall on, without a sublayer: they damp more, and the higher the faster the flow.
        assert!(near < if reynolds < 2e4 { 0.2 } else { 0.8 } * far, "{reynolds}: {near} {far}");
    }
}

/// A rough wall has more friction, and its turbulence reaches nearer to it: less that is unsteady.
#[test]
fn the_steady_state_stays_for_every_law_of_friction() {
    for friction in ["", "friction_factor = 0.03", "friction_factor = 0.0", "roughness_mm = 0.5"] {
        for velocity in [0.0, 0.05, 1.0] {
            let case = Case { velocity, friction, closing_s: 1e12, ..laminar() };
            let head = case.head(40, &times(200, 0.5));
            assert!(head.iter().all(|h| h.abs() < 1e-6), "{friction} {velocity}: {head:?}");
        }
    }
}

#[test]
fn it_is_not_added_to_another_friction() {
    for other in ["unsteady-friction", "unsteady-friction/brunone"] {
        let refused = parse_list(&format!("{other},{QUASI_2D}")).unwrap_err().to_string();
        assert!(refused.contains("same friction"), "{refused}");
    }
}
