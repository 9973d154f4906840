//! Unsteady friction against Zielke's exact solution, Joukowsky's head, and the base model that it grows out of.

use super::exact::{Exact, Ramp, bessel_ratio};
use super::{largest_error, orders, reference, relative_rms, rig};
use nalgebra::Complex;
use surgescope::model::boundary::Closure;
use surgescope::model::effects::parse_list;
use surgescope::model::trace::Probe;
use surgescope::model::{Conditions, Model, ModelError, Resolution, RunValues};

const CONVOLUTION: &str = "unsteady-friction";
const BRUNONE: &str = "unsteady-friction/brunone";

/// One pipe, one run.
#[derive(Clone)]
struct Case {
    length: f64,
    diameter: f64,
    wave_speed: f64,
    velocity: f64,
    viscosity: f64,
    closure: fn(f64) -> Closure,
    closing: f64,
    effects: &'static str,
    values: Vec<f64>,
}

impl Case {
    /// Deviation of the head at the valve.
    fn try_head(&self, reaches: usize, times: &[f64]) -> Result<Vec<f64>, ModelError> {
        let rig = rig(self.length, self.diameter * 1e3, 2.0, "");
        let mut water = rig.fluid.properties(20.0);
        water.density_kg_m3 = 1000.0;
        water.kinematic_viscosity_m2_s = self.viscosity;
        let mut model = Model::new(&rig, &water, &parse_list(self.effects).unwrap());
        model.closure = self.closure;
        let run = RunValues {
            initial_velocity_m_s: self.velocity,
            valve_head_m: 60.0,
            closing_time_s: self.closing,
            friction_scale: 1.0,
        };
        let shared: Vec<f64> = [self.wave_speed].into_iter().chain(self.values.iter().copied()).collect();
        let resolution = Resolution { reaches, duration_s: times.iter().copied().fold(0.0, f64::max) };
        let conditions = Conditions { water, supply_deviation: None };
        let simulated = model.simulate(&conditions, &shared, &run, resolution, &[Probe::Head(self.length)])?;
        Ok(times.iter().map(|&t| simulated.traces[0].at(t) - 60.0).collect())
    }

    fn head(&self, reaches: usize, times: &[f64]) -> Vec<f64> {
        self.try_head(reaches, times).unwrap()
    }
}

fn cosine(closing_time_s: f64) -> Closure {
    Closure::FlowRamp { closing_time_s }
}

fn cycloid(closing_time_s: f64) -> Closure {
    Closure::FlowCycloid { closing_time_s }
}

fn linear(closing_time_s: f64) -> Closure {
    Closure::Linear { closing_time_s }
}

const B2_VISCOSITY: f64 = 1.181818e-6;

/// Adelaide's copper pipe, laminar: the exact problem and ours.
fn b2(velocity: f64, ramp: Ramp) -> (Exact, Case) {
    let (closure, closing): (fn(f64) -> Closure, f64) = match ramp {
        Ramp::Cosine(tc) => (cosine, tc),
        Ramp::Cycloid(tc) => (cycloid, tc),
    };
    let exact = Exact {
        length: 37.23,
        diameter: 0.0221,
        wall: 0.002,
        wave_speed: 1319.0,
        density: 1000.0,
        velocity,
        ramp,
        creep: vec![],
        viscosity: Some(B2_VISCOSITY),
    };
    let case = Case {
        length: 37.23,
        diameter: 0.0221,
        wave_speed: 1319.0,
        velocity,
        viscosity: B2_VISCOSITY,
        closure,
        closing,
        effects: CONVOLUTION,
        values: vec![1.0],
    };
    (exact, case)
}

fn times(count: u32, step: f64) -> Vec<f64> {
    (0..count).map(|i| f64::from(i) * step).collect()
}

/// `I₀/I₂` on both sides of the change of method, against values from tables (Abramowitz & Stegun 9.8) and against each other.
#[test]
fn the_bessel_ratio_is_right() {
    let at = |re, im| bessel_ratio(Complex::new(re, im));
    assert!((at(1.0, 0.0).re * 0.135_747_669_8 / 1.266_065_877_8 - 1.0).abs() < 1e-8);
    assert!((at(5.0, 0.0).re * 17.505_614_966 / 27.239_871_824 - 1.0).abs() < 1e-8);
    for angle in [0.0, 0.5, std::f64::consts::FRAC_PI_4] {
        let on = |size: f64| bessel_ratio(Complex::from_polar(size, angle));
        // Smooth across |z| = 30: the middle of three equally spaced values is their mean up to curvature.
        let bend = on(30.0 - 1e-4) - on(30.0 + 1e-4);
        let slope = (on(30.1) - on(30.0 + 1e-4)) / 0.0999;
        assert!((bend + slope * 2e-4).norm() < 1e-8, "{angle}: {bend}");
    }
}

#[test]
fn the_exact_laminar_solution_meets_its_reference_file() {
    let file = reference(include_str!("../reference/B2_zielke_laminar.csv"));
    let (exact, _) = b2(0.1, Ramp::Cycloid(0.009));
    let error = largest_error(&exact.head(37.23, &file[0]), &file[1]);
    assert!(error < 3e-4, "{error}");
}

#[test]
fn laminar_friction_converges_to_b2() {
    let file = reference(include_str!("../reference/B2_zielke_laminar.csv"));
    let (_, case) = b2(0.1, Ramp::Cycloid(0.009));
    let errors = [64, 128, 256].map(|n| largest_error(&case.head(n, &file[0]), &file[1]));
    println!("B2 largest error {errors:?}, orders {:?}", orders(&errors));
    assert!(errors[2] <= 0.05, "{errors:?}");
}

/// Relative rms at the valve over 15 periods, both closures.
#[test]
fn laminar_friction_is_exact_to_three_thousandths_at_240_reaches() {
    for ramp in [Ramp::Cosine(0.009), Ramp::Cycloid(0.009)] {
        let (exact, case) = b2(0.05, ramp);
        let times = times(3000, 5e-4);
        let head = exact.head(37.23, &times);
        let errors = [60, 120, 240, 480].map(|n| relative_rms(&case.head(n, &times), &head));
        println!("relative rms {errors:?}, orders {:?}", orders(&errors));
        assert!(errors[2] <= 3e-3, "{errors:?}");
    }
}

/// Every friction model, L 1000 m, a 1000 m/s, D 0.5 m, V0 1 m/s.
#[test]
fn joukowsky_and_packing_at_every_grid() {
    for (effects, values, viscosity, velocity) in [
        ("none", vec![], 1e-6, 1.0),
        (CONVOLUTION, vec![1.0], 1e-6, 1.0),
        (BRUNONE, vec![1.0], 1e-6, 1.0),
        ("none", vec![], 4e-4, 1.0),
        (CONVOLUTION, vec![1.0], 4e-4, 1.0),
        (BRUNONE, vec![1.0], 4e-4, 1.0),
        (BRUNONE, vec![4.0], 4e-4, 1.0),
    ] {
        for (closure, closing) in [(linear as fn(f64) -> Closure, 0.0), (cosine, 0.0), (cosine, 0.3), (linear, 0.3)] {
            let case = Case {
                length: 1000.0,
                diameter: 0.5,
                wave_speed: 1000.0,
                velocity,
                viscosity,
                closure,
                closing,
                effects,
                values: values.clone(),
            };
            let joukowsky = 1000.0 * velocity / 9.81;
            let times = times(2000, 0.04);
            let finest = case.head(2000, &times);
            for n in [25, 50, 100, 250, 500, 1000] {
                let h = case.head(n, &times);
                let first = h[..50].iter().copied().fold(f64::MIN, f64::max);
                let low = h.iter().copied().fold(f64::MAX, f64::min);
                println!(
                    "{effects} {values:?} nu {viscosity} Tc {closing} n {n}: first {:.4} low {:.4} end {:.4} rms to finest {:.5}",
                    first / joukowsky,
                    low / joukowsky,
                    h[1900..].iter().copied().fold(f64::MIN, f64::max) / joukowsky,
                    relative_rms(&h, &finest)
                );
            }
        }
    }
}
