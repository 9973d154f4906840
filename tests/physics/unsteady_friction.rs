//! Unsteady friction against exact solutions, Joukowsky's head, and the base model that it grows out of.

use super::exact::{Exact, Ramp, Shear, bessel_ratio};
use super::{cosine, cycloid, largest_error, linear, orders, reference, relative_rms, rig};
use nalgebra::Complex;
use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, ModelError, Resolution, RunValues};

const CONVOLUTION: &str = "unsteady-friction";
const BRUNONE: &str = "unsteady-friction/brunone";

/// One run on one pipe.
#[derive(Clone)]
struct Case {
    length: f64,
    diameter: f64,
    wave_speed: f64,
    velocity: f64,
    viscosity: f64,
    /// More lines of the rig's pipe.
    friction: &'static str,
    closure: fn(f64) -> Closure,
    closing: f64,
    effects: &'static str,
    values: Vec<f64>,
}

impl Case {
    /// Deviation of the head at the valve.
    fn try_head(&self, reaches: usize, times: &[f64]) -> Result<Vec<f64>, ModelError> {
        let rig = rig(self.length, self.diameter * 1e3, 2.0, self.friction);
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
        let wave_speeds = rig.pipes.iter().map(|_| self.wave_speed);
        let shared: Vec<f64> = wave_speeds.chain(self.values.iter().copied()).collect();
        let resolution = Resolution { reaches, duration_s: times.iter().copied().fold(0.0, f64::max) };
        let conditions = Conditions::of(water);
        let valve = [Probe::head(rig.pipes.iter().map(|p| p.length_m).sum::<f64>())];
        let simulated = model.simulate(&conditions, &shared, &run, resolution, &valve)?;
        Ok(times.iter().map(|&t| simulated.traces[0].at(t) - 60.0).collect())
    }

    fn head(&self, reaches: usize, times: &[f64]) -> Vec<f64> {
        self.try_head(reaches, times).unwrap()
    }

    fn with(&self, effects: &'static str, values: &[f64]) -> Case {
        Case { effects, values: values.to_vec(), ..self.clone() }
    }

    /// Orders of convergence from the differences between grids, each twice as fine as the one before.
    fn own_orders(&self, coarsest: usize, grids: u32, times: &[f64]) -> Vec<f64> {
        let heads: Vec<_> = (0..grids).map(|k| self.head(coarsest << k, times)).collect();
        orders(&heads.windows(2).map(|w| relative_rms(&w[0], &w[1])).collect::<Vec<_>>())
    }
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
        shear: Shear::Laminar { viscosity: B2_VISCOSITY },
    };
    let case = Case {
        length: 37.23,
        diameter: 0.0221,
        wave_speed: 1319.0,
        velocity,
        viscosity: B2_VISCOSITY,
        friction: "",
        closure,
        closing,
        effects: CONVOLUTION,
        values: vec![1.0],
    };
    (exact, case)
}

/// L 1000 m, a 1000 m/s, D 0.5 m, V0 1 m/s, water: Re 500 000.
fn large(closure: fn(f64) -> Closure, closing: f64) -> Case {
    Case {
        length: 1000.0,
        diameter: 0.5,
        wave_speed: 1000.0,
        velocity: 1.0,
        viscosity: 1e-6,
        friction: "",
        closure,
        closing,
        effects: "none",
        values: vec![],
    }
}

fn times(count: u32, step: f64) -> Vec<f64> {
    (0..count).map(|i| f64::from(i) * step).collect()
}

/// `I₀/I₂` against tables (Abramowitz & Stegun 9.8), and smooth across |z| = 30, where the method changes.
#[test]
fn the_bessel_ratio_is_right() {
    let at = |re, im| bessel_ratio(Complex::new(re, im));
    assert!((at(1.0, 0.0).re * 0.135_747_669_8 / 1.266_065_877_8 - 1.0).abs() < 1e-8);
    assert!((at(5.0, 0.0).re * 17.505_614_966 / 27.239_871_824 - 1.0).abs() < 1e-8);
    for angle in [0.0, 0.5, std::f64::consts::FRAC_PI_4] {
        let on = |size: f64| bessel_ratio(Complex::from_polar(size, angle));
        let jump = on(30.0 + 1e-4) - on(30.0 - 1e-4);
        let slope = (on(30.1) - on(30.0 + 1e-4)) / 0.0999;
        assert!((jump - slope * 2e-4).norm() < 1e-8, "{angle}: {jump}");
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
    println!("B2, largest error in m at 64, 128, 256 reaches: {errors:?}");
    assert!(errors[2] <= 0.02, "{errors:?}");
    assert!(orders(&errors).iter().all(|&o| o > 1.3), "{errors:?}");
}

/// Relative rms at the valve over 13 periods, both closures. What is left on fine grids is the sum of exponentials' own
/// error.
#[test]
fn laminar_friction_is_exact_to_a_thousandth_at_240_reaches() {
    for ramp in [Ramp::Cosine(0.009), Ramp::Cycloid(0.009)] {
        let (exact, case) = b2(0.05, ramp);
        let times = times(3000, 5e-4);
        let head = exact.head(37.23, &times);
        let errors = [60, 120, 240, 480].map(|n| relative_rms(&case.head(n, &times), &head));
        println!("laminar, relative rms at 60, 120, 240, 480 reaches: {errors:?}");
        assert!(errors[2] <= 1e-3 && errors[3] <= 5e-4, "{errors:?}");
        assert!(errors.windows(2).all(|w| w[1] < w[0]), "{errors:?}");
    }
}

/// Turbulent flow without steady friction is linear, too.
#[test]
fn turbulent_friction_is_vardy_and_browns() {
    let (exact, case) = b2(1.0, Ramp::Cosine(0.009));
    let shear = Shear::Turbulent { viscosity: B2_VISCOSITY, reynolds: 1.0 * 0.0221 / B2_VISCOSITY };
    let (exact, case) = (Exact { shear, ..exact }, Case { friction: "friction_factor = 0.0", ..case });
    let times = times(2000, 5e-4);
    let head = exact.head(37.23, &times);
    let errors = [60, 120, 240].map(|n| relative_rms(&case.head(n, &times), &head));
    println!("turbulent, relative rms at 60, 120, 240 reaches: {errors:?}");
    assert!(errors[2] <= 1e-3, "{errors:?}");
    assert!(orders(&errors).iter().all(|&o| o > 0.9), "{errors:?}");
}

/// Creep of the wall and laminar friction together have an exact solution as well.
#[test]
fn friction_and_creep_together_are_exact() {
    let (exact, case) = b2(0.05, Ramp::Cosine(0.02));
    let creep = vec![(5e-12, 0.02), (5e-12, 0.2)];
    let exact = Exact { creep: creep.clone(), ..exact };
    let case = case.with("unsteady-friction,viscoelastic-wall:2", &[1.0, 5e-3, 0.02, 5e-3, 0.2]);
    let times = times(1000, 1e-3);
    let error = relative_rms(&case.head(240, &times), &exact.head(37.23, &times));
    assert!(error < 1e-3, "{error}");
}

/// Second-order in space and time but for the kernel's `1/√t`: it leaves an order of 1.5 behind a front. Brunone's
/// differences are upwind: order 1.
#[test]
fn refinement_converges_at_the_order_of_theory() {
    for (effects, viscosity, least) in
        [(CONVOLUTION, 1e-6, 1.35), (CONVOLUTION, 4e-4, 1.35), (BRUNONE, 1e-6, 0.9), (BRUNONE, 4e-4, 0.9)]
    {
        let case = Case { viscosity, ..large(cosine, 1.5) }.with(effects, &[1.0]);
        let orders = case.own_orders(100, 4, &times(800, 0.025));
        println!("{effects}, viscosity {viscosity}: orders {orders:?}");
        assert!(orders.iter().all(|&o| o > least), "{effects}: {orders:?}");
    }
}

/// The gate of every friction model: the first rise is Joukowsky's plus packing at every grid, and grids agree ever
/// better.
#[test]
#[ignore = "takes 22 s; CI runs it at night"]
fn the_first_rise_is_joukowskys_at_every_grid() {
    let joukowsky = 1000.0 * 1.0 / 9.81;
    let factor = surgescope_core::rig::darcy_friction_factor(5e5, 0.0);
    let packing = factor * 1000.0 / 0.5 * 1.0 / (2.0 * 9.81);
    // At the coarsest grid's own steps: between them a square front has no height.
    let times = times(500, 0.04);
    for (effects, values) in [("none", vec![]), (CONVOLUTION, vec![1.0]), (BRUNONE, vec![1.0]), (BRUNONE, vec![4.0])] {
        for case in [large(linear, 0.0), large(cosine, 0.3)].map(|case| case.with(effects, &values)) {
            let finest = case.head(2000, &times);
            let mut offs = Vec::new();
            for n in [25, 50, 100, 250, 500, 1000] {
                let head = case.head(n, &times);
                assert!(head.iter().all(|h| h.is_finite()), "{effects} {values:?} at {n} reaches");
                let first = head[..50].iter().copied().fold(f64::MIN, f64::max) / (joukowsky + packing);
                assert!((first - 1.0).abs() < 0.03, "{effects} {values:?} at {n} reaches: {first}");
                // Mean size, the measure in which steep fronts converge.
                let off = head.iter().zip(&finest).map(|(a, b)| (a - b).abs()).sum::<f64>() / head.len() as f64;
                offs.push(off / joukowsky);
            }
            println!("{effects} {values:?}: off the finest grid by {offs:?}");
            assert!(
                offs[2] < 0.05 && offs[2..].windows(2).all(|w| w[1] < 0.7 * w[0]),
                "{effects} {values:?}: {offs:?}"
            );
        }
    }
}

/// Laminar and thick, where unsteady friction is a tenth of Joukowsky's head and Brunone's `k` largest, without the
/// damping of steady friction: nothing grows.
#[test]
fn nothing_grows_however_strong_the_friction() {
    let times = times(4000, 0.02);
    for (effects, scale) in [(CONVOLUTION, 1.0), (CONVOLUTION, 4.0), (BRUNONE, 1.0), (BRUNONE, 4.0), (BRUNONE, 20.0)] {
        for n in [25, 100, 400] {
            let case = Case { viscosity: 4e-4, friction: "friction_factor = 0.0", ..large(linear, 0.0) };
            let head = case.with(effects, &[scale]).head(n, &times);
            let largest = |part: &[f64]| part.iter().fold(0.0f64, |a, h| a.max(h.abs()));
            let by_period: Vec<f64> = head.chunks(200).map(largest).collect();
            assert!(by_period.windows(2).all(|w| w[1] < w[0]), "{effects} {scale} at {n} reaches: {by_period:?}");
        }
    }
}

/// Brunone without steady friction, sudden closure: a wave that slows the flow keeps speed `a` and `ΔH = -a ΔV/g`, one
/// that speeds it up has speed `a/(1+k)` and `ΔH = a (1+k) ΔV/g` (the equation's characteristics). So each reflection
/// at the supply divides head and flow by `1 + k`, and `n` half periods last `n (2 + k) L/a`.
#[test]
fn brunones_plateaus_fall_by_one_plus_k() {
    let velocity = 0.001;
    let k = 0.5 * 0.00476f64.sqrt();
    for (scale, reaches) in [(1.0, 25), (1.0, 100), (1.0, 1000), (3.0, 200)] {
        let case = Case { velocity, friction: "friction_factor = 0.0", ..large(cosine, 0.0) }.with(BRUNONE, &[scale]);
        let k = scale * k;
        // Steps that spread over many reaches smooth a late plateau's rims: its middle is read.
        let middles: Vec<f64> = (0..8).map(|n| (f64::from(n) + 0.5) * (2.0 + k)).collect();
        for (n, head) in case.head(reaches, &middles).iter().enumerate() {
            let exact = 1000.0 * velocity / 9.81 * (-1f64).powi(n as i32) / (1.0 + k).powi(n as i32);
            assert!((head / exact - 1.0).abs() < 2e-3, "k {k:.3}, {reaches} reaches, {n}: {head} {exact}");
        }
        // Halfway up the ninth front.
        let front = 8.0 * (2.0 + k);
        let step = 1.0 / reaches as f64;
        let around: Vec<f64> = times((1.8 / step) as u32, step).iter().map(|t| front - 0.9 + t).collect();
        let heads = case.head(reaches, &around);
        let crossing = around.iter().zip(&heads).find(|(_, head)| **head >= 0.0).unwrap().0;
        assert!((crossing - front).abs() < 2.0 * step, "k {k:.3}, {reaches} reaches: {crossing} {front}");
    }
}

/// A pipe in two pieces of the same kind is the same pipe, also where the joint lies on no node.
#[test]
fn a_joint_in_a_uniform_pipe_changes_nothing() {
    let (_, whole) = b2(0.05, Ramp::Cosine(0.009));
    let times = times(500, 1e-3);
    let mut cut = Case { length: 20.0, ..whole.clone() };
    cut.friction = "[[pipe]]\nname = \"rest\"\nlength_m = 17.23\ninner_diameter_mm = 22.1\nwall_thickness_mm = 2.0\nmaterial = \"HDPE\"\n\
                    constraint = 1.0\n";
    assert!(relative_rms(&cut.head(100, &times), &whole.head(100, &times)) < 1e-9);
}

#[test]
fn the_steady_state_stays() {
    for (effects, viscosity) in [(CONVOLUTION, 1e-6), (CONVOLUTION, 1e-3), (BRUNONE, 1e-6), (BRUNONE, 1e-3)] {
        let still = |closing_time_s| Closure::Linear { closing_time_s: 1e12 + closing_time_s };
        let case = Case { viscosity, ..large(still, 1.0) }.with(effects, &[1.0]);
        let head = case.head(40, &times(200, 0.5));
        assert!(largest_error(&head, &[0.0; 200]) < 1e-7, "{effects}: {:e}", largest_error(&head, &[0.0; 200]));
    }
}

#[test]
fn bad_values_and_both_at_once_are_refused() {
    for (effects, name) in [(CONVOLUTION, "unsteady_friction_scale"), (BRUNONE, "brunone_scale")] {
        for value in [-0.1, f64::NAN, f64::INFINITY] {
            let error = large(linear, 0.1).with(effects, &[value]).try_head(20, &[1.0]).unwrap_err().to_string();
            assert!(error.contains(name), "{error}");
        }
    }
    let both = parse_list("unsteady-friction,unsteady-friction/brunone").unwrap_err().to_string();
    assert!(both.contains("same friction"), "{both}");
}
