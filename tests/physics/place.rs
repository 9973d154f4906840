//! Effects at one place of the line, against the exact solution of the linear network, reflections by hand, and
//! conservation.

use super::exact::{Ramp, invert};
use super::{cosine, cycloid, largest_error, linear, relative_rms, rig};
use nalgebra::Complex;
use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::Probe;
use surgescope_core::model::{Conditions, Model, ModelError, Resolution, RunValues, Simulated};

type C = Complex<f64>;
const G: f64 = 9.81;
const LENGTH: f64 = 100.0;
const SPEED: f64 = 1000.0;
const DIAMETER: f64 = 0.05;
const HEAD: f64 = 60.0;

fn area() -> f64 {
    std::f64::consts::FRAC_PI_4 * DIAMETER * DIAMETER
}

/// Impedance of the pipe, `a/(gA)`.
fn impedance() -> f64 {
    SPEED / (G * area())
}

/// One run of a horizontal pipe.
#[derive(Clone, Copy)]
struct Case<'a> {
    effects: &'a str,
    values: &'a [f64],
    velocity: f64,
    closure: fn(f64) -> Closure,
    closing: f64,
    friction: &'a str,
}

impl<'a> Case<'a> {
    /// Without friction, closed all at once.
    fn sudden(effects: &'a str, values: &'a [f64], velocity: f64) -> Case<'a> {
        Case { effects, values, velocity, closure: cosine, closing: 1e-9, friction: "friction_factor = 0.0" }
    }

    fn run(&self, reaches: usize, duration_s: f64, probes: &[Probe]) -> Result<Simulated, ModelError> {
        let rig = rig(LENGTH, DIAMETER * 1e3, 2.0, self.friction);
        let water = rig.fluid.properties(20.0);
        let mut model = Model::new(&rig, &water, &parse_list(self.effects).unwrap());
        model.closure = self.closure;
        let run = RunValues {
            initial_velocity_m_s: self.velocity,
            valve_head_m: HEAD,
            closing_time_s: self.closing,
            friction_scale: 1.0,
        };
        let shared: Vec<f64> = [SPEED].into_iter().chain(self.values.iter().copied()).collect();
        let conditions = Conditions::of(water);
        model.simulate(&conditions, &shared, &run, Resolution { reaches, duration_s }, probes)
    }

    /// Deviation of the head at the valve.
    fn head(&self, reaches: usize, times: &[f64]) -> Vec<f64> {
        let duration_s = times.iter().copied().fold(0.0, f64::max);
        let simulated = self.run(reaches, duration_s, &[Probe::head(LENGTH)]).unwrap();
        times.iter().map(|&t| simulated.traces[0].at(t) - HEAD).collect()
    }
}

fn times(count: usize, duration_s: f64) -> Vec<f64> {
    (0..count).map(|i| i as f64 * duration_s / count as f64).collect()
}

/// A piece of a linear network, from the supply on.
enum Part {
    /// A frictionless pipe: length, wave speed.
    Pipe(f64, f64),
    /// A flow out of the node of so much per head.
    Conductance(f64),
    /// A head loss of so much per flow.
    Resistance(f64),
    /// A closed pipe: length, cross-section over that of the line.
    Branch(f64, f64),
}

/// Exact deviation of the head at the valve when the flow there falls from `flow` to nothing: the product of the parts'
/// transfer matrices (Chaudhry 2014, Applied Hydraulic Transients, ch. 8), inverted.
fn network(parts: &[Part], flow: f64, ramp: Ramp, times: &[f64]) -> Vec<f64> {
    let transform = |s: C| {
        let (mut h, mut q) = (C::from(0.0), C::from(1.0));
        for part in parts {
            match *part {
                Part::Pipe(length, speed) => {
                    let b = speed / (G * area());
                    let (sh, ch) = ((s * length / speed).sinh(), (s * length / speed).cosh());
                    (h, q) = (h * ch - q * sh * b, q * ch - h * sh / b);
                }
                Part::Conductance(y) => q -= h * y,
                Part::Resistance(r) => h -= q * r,
                Part::Branch(length, ratio) => q -= h * (s * length / SPEED).tanh() * (ratio / impedance()),
            }
        }
        -(h / q) * flow * ramp.transform(s) / s
    };
    invert(transform, times)
}

/// Errors against the exact solution fall by the square of the step. How a place lies between nodes makes single
/// halvings uneven, so the order is that of four together.
fn assert_second_order(case: Case, exact: &[f64], times: &[f64], at_160: f64) {
    let errors = [40, 160, 640].map(|n| relative_rms(&case.head(n, times), exact));
    let order = 0.25 * (errors[0] / errors[2]).log2();
    assert!(errors[1] < at_160 && order > 1.8, "{} {:?}: {errors:?}, order {order}", case.effects, case.values);
}

/// Velocity of flows that are small enough for a linear network, m/s.
const SLOW: f64 = 1e-7;

/// Flows so small that leak and blockage are linear: `dQ/dH = Q/2H`, `dΔH/dQ = 2ΔH/Q`.
fn smooth<'a>(effects: &'a str, values: &'a [f64]) -> Case<'a> {
    Case { effects, values, velocity: SLOW, closure: cycloid, closing: 0.12, friction: "friction_factor = 0.0" }
}

#[test]
fn a_leak_converges_to_the_exact_solution() {
    let (x, cda_mm2) = (61.7, 12.0);
    let times = times(600, 3.0);
    let conductance = cda_mm2 * 1e-6 * (2.0 * G * HEAD).sqrt() / (2.0 * HEAD);
    let parts = [Part::Pipe(x, SPEED), Part::Conductance(conductance), Part::Pipe(LENGTH - x, SPEED)];
    let exact = network(&parts, SLOW * area(), Ramp::Cycloid(0.12), &times);
    assert_second_order(smooth("leak", &[x, cda_mm2]), &exact, &times, 1e-3);
}

#[test]
fn a_blockage_with_a_leak_beyond_it_converges_to_the_exact_solution() {
    let (block, k, leak, cda_mm2) = (33.1, 4000.0, 71.3, 12.0);
    let times = times(600, 3.0);
    let leaked = cda_mm2 * 1e-6 * (2.0 * G * HEAD).sqrt();
    let parts = [
        Part::Pipe(block, SPEED),
        Part::Resistance(2.0 * k * leaked / (2.0 * G * area() * area())),
        Part::Pipe(leak - block, SPEED),
        Part::Conductance(leaked / (2.0 * HEAD)),
        Part::Pipe(LENGTH - leak, SPEED),
    ];
    let exact = network(&parts, SLOW * area(), Ramp::Cycloid(0.12), &times);
    assert_second_order(smooth("leak,blockage", &[leak, cda_mm2, block, k]), &exact, &times, 1e-3);
}

#[test]
fn a_section_converges_to_the_exact_solution() {
    let times = times(600, 3.0);
    for (start, length, ratio) in [(40.0, 35.0, 1.3), (23.0, 30.0, 0.6), (55.0, 3.0, 0.5), (0.0, 20.0, 1.5)] {
        let end = start + length;
        let parts = [Part::Pipe(start, SPEED), Part::Pipe(length, ratio * SPEED), Part::Pipe(LENGTH - end, SPEED)];
        let exact = network(&parts, SLOW * area(), Ramp::Cycloid(0.12), &times);
        assert_second_order(smooth("section-change", &[start, end, ratio, 1.0]), &exact, &times, 1e-3);
    }
}

/// Echoes and modes of the branch, a stub shorter than a reach included.
#[test]
fn a_branch_converges_to_the_exact_solution() {
    let times = times(600, 3.0);
    for (x, length, ratio) in [(61.7, 10.0, 1.0), (30.0, 34.0, 0.4), (50.0, 0.4, 1.0)] {
        let parts = [Part::Pipe(x, SPEED), Part::Branch(length, ratio), Part::Pipe(LENGTH - x, SPEED)];
        let exact = network(&parts, SLOW * area(), Ramp::Cycloid(0.12), &times);
        assert_second_order(smooth("side-branch", &[x, length, ratio]), &exact, &times, 1e-3);
    }
}

/// A leak of any size passes on a step `h` of `2(h' - h)/B = Q(H) - Q(H + h')` and sends back `h' - h`, which the shut
/// valve doubles.
#[test]
fn a_leak_reflects_as_its_orifice_says() {
    let (x, cda_mm2, velocity) = (50.0, 40.0, 0.5);
    let rise = SPEED * velocity / G;
    let leak = |head: f64| cda_mm2 * 1e-6 * (2.0 * G * head).sqrt();
    let passed = bisect(0.0, rise, |h| 2.0 * (h - rise) / impedance() + leak(HEAD + h) - leak(HEAD));
    let heads = Case::sudden("leak", &[x, cda_mm2], velocity).head(100, &[0.05, 0.19]);
    assert!((heads[0] / rise - 1.0).abs() < 1e-9);
    assert!((heads[1] / (rise + 2.0 * (passed - rise)) - 1.0).abs() < 1e-9, "{heads:?} {passed} {rise}");
}

/// A blockage sends back `h = B (Q0 - Q) - h0` with `k (Q0² - Q²) + 2B (Q0 - Q) = 2 h0`.
#[test]
fn a_blockage_reflects_as_its_loss_says() {
    let (x, k, velocity) = (50.0, 300.0, 0.5);
    let rise = SPEED * velocity / G;
    let (q0, loss) = (velocity * area(), k / (2.0 * G * area() * area()));
    let q = bisect(-q0, q0, |q| 2.0 * rise - loss * (q0 * q0 - q * q.abs()) - 2.0 * impedance() * (q0 - q));
    let back = rise - impedance() * (q0 - q);
    let values = [x, k];
    let case = Case::sudden("blockage", &values, velocity);
    let heads = case.head(100, &[0.05, 0.19]);
    assert!((heads[0] / rise - 1.0).abs() < 1e-9);
    assert!(back > 0.0 && (heads[1] / (rise + 2.0 * back) - 1.0).abs() < 1e-9, "{heads:?} {back}");
    // The steady loss is K V²/2g.
    let steady = case.run(100, 0.1, &[Probe::head(0.0), Probe::head(LENGTH)]).unwrap();
    let lost = steady.traces[0].at(0.0) - steady.traces[1].at(0.0);
    assert!((lost - k * velocity * velocity / (2.0 * G)).abs() < 1e-9, "{lost}");
}

/// A section whose ends lie on nodes: `(B₂ - B₁)/(B₂ + B₁)` from its near end, then the far end's, in their travel
/// times.
#[test]
fn a_section_reflects_as_its_impedances_say() {
    let (start, length, ratio, velocity) = (40.0, 40.0, 2.0, 0.5);
    let rise = SPEED * velocity / G;
    let r = (ratio - 1.0) / (ratio + 1.0);
    let values = [start, start + length, ratio, 1.0];
    let case = Case::sudden("section-change", &values, velocity);
    // 20 m there and back at 1000 m/s, 40 m at 2000 m/s, 40 m at 1000 m/s.
    let dt = 0.08 / 80.0;
    let heads = case.head(80, &[0.04 - dt, 0.04 + dt, 0.08 - dt, 0.08 + 2.0 * dt]);
    let near = rise * (1.0 + 2.0 * r);
    let far = near + 2.0 * rise * (1.0 - r * r) * -r + 2.0 * rise * r * r;
    let exact = [rise, near, near, far];
    assert!(largest_error(&heads, &exact) < 1e-9 * rise, "{heads:?} {exact:?}");
    // The supply's own reflection is back after the whole line's travel time, L/a of its three pieces.
    let before = case.head(80, &[0.16 - 1.5 * dt])[0];
    let after = case.head(80, &[0.16 + 1.5 * dt])[0];
    assert!(before - after > rise, "{before} {after}");
}

/// Three equal pipes meet: `-1/3` comes back, and what goes into the branch and comes out of it, `(2/3)²` of the step,
/// after the branch's travel time there and back.
#[test]
fn a_branch_reflects_a_third_and_echoes() {
    let (x, length, velocity) = (50.0, 20.0, 0.5);
    let rise = SPEED * velocity / G;
    let heads = Case::sudden("side-branch", &[x, length, 1.0], velocity).head(200, &[0.09, 0.12, 0.16]);
    let exact = [rise, rise * (1.0 - 2.0 / 3.0), rise * (1.0 - 2.0 / 3.0 + 8.0 / 9.0)];
    assert!(largest_error(&heads, &exact) < 1e-9 * rise, "{heads:?} {exact:?}");
}

/// Water is conserved: before the closure the supply gives what valve and leak take, long after it what the leak takes.
#[test]
fn the_supply_feeds_valve_and_leak() {
    let (x, cda_mm2, velocity) = (37.9, 25.0, 0.3);
    let values = [x, cda_mm2];
    let case = Case {
        closure: linear,
        closing: 0.3,
        friction: "friction_factor = 0.05",
        ..Case::sudden("leak", &values, velocity)
    };
    let probes = [Probe::flow(0.0), Probe::head(x), Probe::head(LENGTH)];
    let run = case.run(60, 400.0, &probes).unwrap();
    let leak = |head: f64| cda_mm2 * 1e-6 * (2.0 * G * head).sqrt();
    for (t, valve) in [(0.0, velocity * area()), (400.0, 0.0)] {
        let (supply, head) = (run.traces[0].at(t), run.traces[1].at(t));
        assert!((supply / (valve + leak(head)) - 1.0).abs() < 2e-3, "{t}: {supply} {head}");
    }
    assert!((run.steady_flow_m3_s(1.0) - run.traces[0].at(0.0)).abs() < 1e-15);
    assert!((run.steady_flow_m3_s(LENGTH) - velocity * area()).abs() < 1e-15);
}

/// A small step of any parameter is a small step of the trace, wherever a node or the end of a section lies.
#[test]
fn traces_move_smoothly_with_place_length_and_strength() {
    let times = times(300, 1.5);
    let cases: [(&str, [f64; 4], usize); 4] = [
        ("leak", [30.0, 40.0, 0.0, 0.0], 2),
        ("blockage", [30.0, 300.0, 0.0, 0.0], 2),
        ("section-change", [30.0, 50.0, 1.4, 1.0], 4),
        ("side-branch", [30.0, 9.0, 1.0, 0.0], 3),
    ];
    for (effect, values, count) in cases {
        let head = |values: &[f64]| {
            let case = Case { closure: linear, closing: 0.1, friction: "", ..Case::sudden(effect, values, 0.7) };
            case.head(40, &times)
        };
        for j in 0..count {
            // Through several nodes; by the same ratios for what is no place.
            let (mut before, mut most) = (Vec::new(), Vec::new());
            let steps = 200;
            for i in 0..=steps {
                let part = f64::from(i) / f64::from(steps);
                let mut moved = values[..count].to_vec();
                moved[j] *= 1.0 + 0.3 * (part - 0.5);
                let at = head(&moved);
                if !before.is_empty() {
                    most.push(largest_error(&at, &before));
                }
                before = at;
            }
            most.sort_by(f64::total_cmp);
            let (median, worst) = (most[most.len() / 2], most[most.len() - 1]);
            assert!(worst < 4.0 * median + 1e-6, "{effect}, parameter {j}: a jump of {worst}, others {median}");
        }
    }
}

#[test]
fn bad_values_are_refused_before_the_run() {
    let refused = |effect: &str, values: &[f64]| {
        Case::sudden(effect, values, 0.5).run(40, 0.1, &[Probe::head(LENGTH)]).map(|_| ()).unwrap_err().to_string()
    };
    for (effect, good, names) in [
        ("leak", vec![50.0, 1.0], ["leak_position_m", "leak_cda_mm2"].as_slice()),
        ("blockage", vec![50.0, 10.0], &["blockage_position_m", "blockage_K"]),
        (
            "section-change",
            vec![50.0, 60.0, 1.2, 1.0],
            &["section_start_m", "section_end_m", "section_wave_speed_ratio", "section_beyond_ratio"],
        ),
        ("side-branch", vec![50.0, 10.0, 1.0], &["branch_position_m", "branch_length_m", "branch_area_ratio"]),
    ] {
        for (j, name) in names.iter().enumerate() {
            for bad in [-1.0, f64::NAN] {
                let mut values = good.clone();
                values[j] = bad;
                let said = refused(effect, &values);
                assert!(said.contains(name), "{effect}: {said}");
            }
        }
        let mut outside = good.clone();
        outside[0] = LENGTH + 1.0;
        assert!(refused(effect, &outside).contains(names[0]));
    }
}

fn bisect(mut low: f64, mut high: f64, f: impl Fn(f64) -> f64) -> f64 {
    let rising = f(high) > f(low);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if (f(middle) > 0.0) == rising {
            high = middle;
        } else {
            low = middle;
        }
    }
    0.5 * (low + high)
}
