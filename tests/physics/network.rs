//! Pipes that branch: exact coefficients at a tee and a dead end, one line split into a network, refinement,
//! conservation, pumps and valves.

use surgescope_core::model::boundary::Closure;
use surgescope_core::model::effects::parse_list;
use surgescope_core::model::trace::{Probe, Trace};
use surgescope_core::model::{Conditions, Model, Resolution, RunValues, Simulated, check_places};
use surgescope_core::rig::{Place, Rig};
use surgescope_core::units::GRAVITY_M_S2;

/// A rig of nodes (the text of each) and pipes (name, from, to, length in m, diameter in mm, wave speed in m/s).
fn rig(nodes: &[&str], pipes: &[(&str, &str, &str, f64, f64, f64)], friction_factor: f64) -> Rig {
    let mut text = "name = \"net\"\n[fluid]\nname = \"water\"\ntemperature_degC = 20.0\n".to_owned();
    nodes.iter().for_each(|node| text += &format!("[[node]]\n{}\n", node.replace("; ", "\n")));
    for (name, from, to, length_m, diameter_mm, wave_speed_m_s) in pipes {
        text += &format!(
            "[[pipe]]\nname = \"{name}\"\nfrom = \"{from}\"\nto = \"{to}\"\nlength_m = {length_m}\ninner_diameter_mm = {diameter_mm}\n\
             wall_thickness_mm = 4.0\nmaterial = \"HDPE\"\nwave_speed_m_s = {wave_speed_m_s}\nfriction_factor = {friction_factor}\n"
        );
    }
    text += "[[sensor]]\nname = \"P1\"\nkind = \"pressure\"\nnode = \"valve\"\nunit = \"m(H2O)\"\n";
    Rig::from_toml(&text, "net.toml").unwrap()
}

const TANK: &str = "name = \"tank\"; kind = \"reservoir\"";
const TEE: &str = "name = \"tee\"; kind = \"junction\"";
const VALVE: &str = "name = \"valve\"; kind = \"valve\"; closing_time_s = 0.02";
const END: &str = "name = \"end\"; kind = \"dead-end\"";

struct Run<'a> {
    effects: &'a str,
    values: &'a [f64],
    velocity_m_s: f64,
    reaches: usize,
    duration_s: f64,
}

impl Run<'_> {
    fn on(&self, rig: &Rig, probes: &[Probe], energy: bool) -> Simulated {
        self.closing(rig, probes, energy, |closing_time_s| Closure::FlowCycloid { closing_time_s })
    }

    fn closing(&self, rig: &Rig, probes: &[Probe], energy: bool, closure: fn(f64) -> Closure) -> Simulated {
        let water = rig.fluid.properties(20.0);
        let effects = parse_list(self.effects).unwrap();
        let mut model = Model::new(rig, &water, &effects);
        model.closure = closure;
        let mut shared: Vec<f64> = rig.pipes.iter().map(|p| p.wave_speed_m_s.unwrap()).collect();
        shared.extend(self.values);
        let run = RunValues {
            initial_velocity_m_s: self.velocity_m_s,
            valve_head_m: 40.0,
            closing_time_s: rig.valve.closing_time_s,
            friction_scale: 1.0,
        };
        let simulate = if energy { Model::simulate_with_energy } else { Model::simulate };
        let resolution = Resolution { reaches: self.reaches, duration_s: self.duration_s };
        simulate(&model, &Conditions::of(water), &shared, &run, resolution, probes).unwrap()
    }
}

fn at(line: usize, position_m: f64) -> Place {
    Place { line, position_m }
}

fn largest_difference(a: &Trace, b: &Trace, duration_s: f64) -> f64 {
    (0..2000).map(|i| f64::from(i) * duration_s / 2000.0).map(|t| (a.at(t) - b.at(t)).abs()).fold(0.0, f64::max)
}

/// `s = 2 Y₁/(Y₁ + Y₂ + Y₃)`, `Y = gA/a`, passes on at a tee, `s - 1` comes back (Wylie & Streeter 1993, ch. 3); at a
/// dead end the wave doubles.
#[test]
fn a_tee_and_a_dead_end_have_their_coefficients() {
    let pipes = [
        ("main", "tank", "tee", 400.0, 60.0, 1000.0),
        ("run", "tee", "valve", 200.0, 40.0, 800.0),
        ("branch", "end", "tee", 150.0, 50.0, 500.0),
    ];
    let rig = rig(&[TANK, TEE, VALVE, END], &pipes, 0.0);
    let probes =
        [Probe::head(at(1, 200.0)), Probe::head(at(1, 100.0)), Probe::head(at(0, 200.0)), Probe::head(at(2, 0.0))];
    let run = Run { effects: "none", values: &[], velocity_m_s: 0.5, reaches: 260, duration_s: 0.9 };
    let heads = run.on(&rig, &probes, false).traces;
    let joukowsky = 800.0 * 0.5 / GRAVITY_M_S2;
    let y = |i: usize| rig.pipes[i].area_m2() / pipes[i].5;
    let passed = 2.0 * y(1) / (y(0) + y(1) + y(2));
    let near = |found: f64, exact: f64, what: &str| {
        assert!((found - 40.0 - exact).abs() < 1e-6 * joukowsky, "{what}: {} for {exact}", found - 40.0)
    };
    // The front leaves the valve at 0 to 0.02 s; the tee is 0.25 s away, the dead end 0.3 s more, the tank 0.4 s.
    near(heads[0].at(0.2), joukowsky, "the first rise");
    near(heads[1].at(0.45), joukowsky * passed, "what came back from the tee");
    near(heads[2].at(0.5), joukowsky * passed, "what went on to the tank");
    near(heads[3].at(0.6), 2.0 * joukowsky * passed, "the dead end");
}

/// The same line, whole and in three pieces, one of them laid the other way: the same to rounding, with all terms along
/// it.
#[test]
fn a_line_split_into_a_network_is_the_line() {
    // Without friction to rounding. At the end of a segment quadratic friction is linearised about the last flow, so
    // that a cut shows there.
    for (friction, bound) in [(0.0, 1e-9), (0.03, 5e-4)] {
        split(friction, bound);
    }
}

fn split(friction: f64, bound: f64) {
    let whole = rig(&[TANK, VALVE], &[("main", "tank", "valve", 120.0, 50.0, 400.0)], friction);
    let a = TEE.replace("tee", "a");
    let b = TEE.replace("tee", "b");
    let pieces = [
        ("one", "tank", "a", 30.0, 50.0, 400.0),
        ("two", "b", "a", 54.0, 50.0, 400.0),
        ("three", "b", "valve", 36.0, 50.0, 400.0),
    ];
    let split = rig(&[TANK, &a, &b, VALVE], &pieces, friction);
    for (effects, values) in [
        ("none", &[][..]),
        ("viscoelastic-wall:2", &[0.1, 0.05, 0.2, 0.5]),
        ("unsteady-friction", &[1.0]),
        ("entrained-gas", &[1e-5, 2e-4]),
        ("air-pocket", &[20.0, 1.2]),
        ("viscoelastic-wall:1,unsteady-friction,valve-seat-leak", &[0.1, 0.1, 1.0, 3.0]),
    ] {
        let run = Run { effects, values, velocity_m_s: 0.4, reaches: 80, duration_s: 4.0 };
        let one = run.on(&whole, &[Probe::head(120.0), Probe::head(47.0), Probe::flow(60.0)], false);
        let other =
            run.on(&split, &[Probe::head(at(2, 36.0)), Probe::head(at(1, 37.0)), Probe::flow(at(1, 24.0))], false);
        let scale = [30.0, 30.0, -1e-3];
        for ((x, y), scale) in one.traces.iter().zip(&other.traces).zip(scale) {
            let y = Trace { values: y.values.iter().map(|v| v * f64::signum(scale)).collect(), ..y.clone() };
            let off = largest_difference(x, &y, 4.0) / f64::abs(scale);
            assert!(off < bound, "{effects} with f = {friction}: {off}");
        }
    }
}

/// Lengths that no common step divides. Ours enter as they are; the usual way changes wave speeds until each pipe has
/// whole reaches. Errors against a grid forty times as fine, RMS over 20 returns of the wave: the page on networks has
/// the table.
#[test]
fn lengths_enter_unadjusted_and_the_error_falls_with_the_square_of_the_step() {
    let pipes = [
        ("main", "tank", "tee", 100.0, 60.0, 1000.0),
        ("run", "tee", "valve", 37.3, 40.0, 1000.0),
        ("branch", "tee", "end", 23.9, 50.0, 1000.0),
    ];
    let slow = VALVE.replace("0.02", "0.1");
    let own = rig(&[TANK, TEE, &slow, END], &pipes, 0.02);
    let duration_s = 2.7;
    let heads = |rig: &Rig, reaches: usize| {
        let run = Run { effects: "none", values: &[], velocity_m_s: 0.4, reaches, duration_s };
        run.on(rig, &[Probe::head(rig.valve_place())], false).traces.remove(0)
    };
    let fine = heads(&own, 2560);
    let error = |trace: &Trace| {
        let times = (0..3000).map(|i| f64::from(i) * duration_s / 3000.0);
        (times.map(|t| (trace.at(t) - fine.at(t)).powi(2)).sum::<f64>() / 3000.0).sqrt()
    };
    let adjusted = |reaches: usize| {
        let dt_s = 0.1373 / reaches as f64;
        let whole = |(name, from, to, length_m, diameter_mm, speed): (
            &'static str,
            &'static str,
            &'static str,
            f64,
            f64,
            f64,
        )| {
            let n = (length_m / speed / dt_s).round().max(1.0);
            (name, from, to, length_m, diameter_mm, length_m / (n * dt_s))
        };
        let rig = rig(&[TANK, TEE, &slow, END], &pipes.map(whole), 0.02);
        // On that step the pipes are whole, up to the rounding of the number of reaches on the way.
        let travel_s: f64 = rig.way_pipes().map(|p| p.length_m / p.wave_speed_m_s.unwrap()).sum();
        heads(&rig, (travel_s / dt_s).round() as usize)
    };
    let (mut first, mut last) = (f64::NAN, f64::NAN);
    for reaches in [16, 32, 64, 128] {
        let (ours, theirs) = (error(&heads(&own, reaches)), error(&adjusted(reaches)));
        println!("{reaches} reaches: {ours:.4} m, with adjusted wave speeds {theirs:.4} m");
        assert!(ours < 0.5 * theirs, "{reaches}: {ours} against {theirs}");
        (first, last) = (if first.is_nan() { ours } else { first }, ours);
    }
    let order = (first / last).log2() / 3.0;
    assert!(order > 1.7, "order {order}");
}

/// A burst in the middle of a line at rest: `q = CdA √(2g H)` comes from both sides, `H = H0 - B q/2`. The table of its
/// opening says how it grows.
#[test]
fn a_burst_takes_what_its_opening_and_the_pipes_allow() {
    let burst = "name = \"burst\"; kind = \"junction\"; elevation_m = 4.0; cda_mm2 = 30.0; opening = [[0.1, 0.0], [0.11, 0.5], [0.2, 0.5], [0.21, 1.0]]";
    let pipes = [("main", "tank", "burst", 500.0, 50.0, 1000.0), ("run", "burst", "valve", 500.0, 50.0, 1000.0)];
    let rig = rig(&[&TANK.replace("reservoir\"", "reservoir\"; head_m = 44.0"), burst, VALVE], &pipes, 0.0);
    let run = Run { effects: "none", values: &[], velocity_m_s: 0.0, reaches: 200, duration_s: 0.55 };
    let made = run.on(&rig, &[Probe::head(at(0, 500.0)), Probe::flow(at(0, 500.0)), Probe::flow(at(1, 0.0))], true);
    let b = 1000.0 / (GRAVITY_M_S2 * rig.pipes[0].area_m2());
    for (t, opening) in [(0.05, 0.0), (0.15, 0.5), (0.5, 1.0)] {
        // The head of the valve, 40 m, is that of the tank: its level of 44 m, and the outlet at 4 m, come down by 4 m.
        let c = opening * 30e-6 * (2.0 * GRAVITY_M_S2).sqrt();
        let root = (b * c / 2.0) / -2.0 + ((b * c / 4.0).powi(2) + 40.0).sqrt();
        let (head, flow) = (root * root, c * root);
        assert!((made.traces[0].at(t) - head).abs() < 1e-9, "{t}: {} for {head}", made.traces[0].at(t));
        assert!((made.traces[1].at(t) - 0.5 * flow).abs() < 1e-12 && (made.traces[2].at(t) + 0.5 * flow).abs() < 1e-12);
    }
    let energy = made.energy.unwrap();
    // Of all that flowed out, to rounding.
    assert!(energy.largest_imbalance_j() < 1e-9 * energy.at(0.55)[3].abs(), "{}", energy.largest_imbalance_j());
}

const PUMPED: [&str; 8] = [
    "name = \"sump\"; kind = \"pump\"; curve_m3_h_m = [[0.0, 40.0], [10.0, 35.0], [20.0, 20.0]]; suction_head_m = 2.0; trip_s = 0.3; inertia_kg_m2 = 0.05; speed_rpm = 2900.0; efficiency_percent = 60.0",
    "name = \"check\"; kind = \"check-valve\"",
    "name = \"tee\"; kind = \"junction\"; demand_m3_h = 2.0",
    "name = \"high\"; kind = \"tank\"; head_m = 30.0; area_m2 = 0.05",
    "name = \"other\"; kind = \"valve\"; cda_mm2 = 60.0; opening = [[0.0, 1.0], [0.5, 0.2]]; discharge_head_m = 0.0",
    "name = \"valve\"; kind = \"valve\"; closing_time_s = 0.1",
    "name = \"far\"; kind = \"junction\"; demand_m3_h = 0.7; cda_mm2 = 20.0; opening = [[0.0, 0.3], [0.2, 0.3], [0.3, 1.0]]; discharge_head_m = 1.5",
    "name = \"end\"; kind = \"dead-end\"",
];

fn pumped() -> Rig {
    let pipes = [
        ("rise", "sump", "check", 20.0, 60.0, 1000.0),
        ("main", "check", "tee", 83.0, 60.0, 1000.0),
        ("up", "tee", "high", 31.7, 50.0, 900.0),
        ("loop", "tee", "far", 40.0, 40.0, 1100.0),
        ("twin", "far", "tee", 61.3, 30.0, 700.0),
        ("waste", "far", "other", 25.0, 40.0, 1000.0),
        ("run", "far", "valve", 47.0, 50.0, 1000.0),
        ("stub", "tee", "end", 21.0, 40.0, 800.0),
    ];
    rig(&PUMPED, &pipes, 0.025)
}

/// Before the closure nothing moves: every element's law holds and every node's flows add up. Afterwards energy and
/// water are all accounted for.
#[test]
fn a_pump_a_tank_a_loop_and_four_kinds_of_valve_balance() {
    let rig = pumped();
    let ends = |line: usize| [at(line, 0.0), at(line, rig.line_length_m(line))];
    let flows: Vec<Probe> = (0..8).flat_map(|line| ends(line).map(Probe::flow)).collect();
    let heads = [at(0, 0.0), at(2, 31.7), at(5, 25.0), at(0, 20.0), at(1, 0.0), at(6, 0.0)].map(Probe::head);
    let probes: Vec<Probe> = flows.into_iter().chain(heads).collect();
    for (effects, values) in [
        ("none", &[][..]),
        ("viscoelastic-wall:1,unsteady-friction,leak,air-pocket", &[0.1, 0.05, 1.0, 20.0, 8.0, 5.0, 1.2]),
    ] {
        let run = Run { effects, values, velocity_m_s: 0.6, reaches: 220, duration_s: 4.0 };
        let made = run.on(&rig, &probes, true);
        let q = |line: usize, end: usize, t: f64| made.traces[2 * line + end].at(t);
        let head = |i: usize, t: f64| made.traces[16 + i].at(t);
        let demand = 2.0 / 3600.0;
        // The datum is the valve's: levels keep their distances.
        let datum = head(1, -1.0) - 30.0;
        for t in [-0.1, 0.05, 0.21, 0.37, 1.3, 3.9] {
            let tee = q(1, 1, t) + q(4, 1, t) - q(2, 0, t) - q(3, 0, t) - q(7, 0, t) - demand;
            let opening = 0.3 + 0.7 * ((t - 0.2) / 0.1).clamp(0.0, 1.0);
            let leak = opening * 20e-6 * (2.0 * GRAVITY_M_S2 * (head(5, t) - 1.5 - datum)).sqrt();
            let far = q(3, 1, t) - q(4, 0, t) - q(5, 0, t) - q(6, 0, t) - leak - 0.7 / 3600.0;
            // Between steps flows are interpolated one by one.
            assert!(tee.abs() < 2e-5 && far.abs() < 2e-5, "{effects} {t}: {tee} {far}");
            assert!(q(7, 1, t).abs() < 1e-12 && q(0, 1, t) >= -1e-12 && q(0, 0, t) >= -1e-12, "{effects} {t}");
        }
        // The pump is on its curve, the other valve an orifice.
        let q0 = q(0, 0, -1.0) * 3600.0;
        let power = (20.0f64 / 5.0).ln() / 2f64.ln();
        let curve = 40.0 - 5.0 * (q0 / 10.0).powf(power);
        assert!((head(0, -1.0) - (2.0 + datum) - curve).abs() < 1e-6, "{effects}: {} {curve}", head(0, -1.0));
        let orifice = 60e-6 * (2.0 * GRAVITY_M_S2 * (head(2, -1.0) - datum)).sqrt();
        assert!((q(5, 1, -1.0) / orifice - 1.0).abs() < 1e-6, "{effects}: {} {orifice}", q(5, 1, -1.0));
        let rest = (0..20)
            .map(|i| 0.001 * f64::from(i) - 0.02)
            .map(|t| (head(1, t) - head(1, -1.0)).abs())
            .fold(0.0, f64::max);
        assert!(rest < 1e-9, "{rest}");
        // The tank rises by what flows into it.
        let dt = made.traces[0].dt_s;
        let inflow = &made.traces[5].values;
        let volume: f64 = inflow.windows(2).map(|w| 0.5 * (w[0] + w[1]) * dt).sum();
        let level = &made.traces[17].values;
        assert!((level[level.len() - 1] - level[0] - volume / 0.05).abs() < 1e-9, "{effects}");
        // After the trip the pump slows down and its check valve shuts.
        assert!(q(0, 0, 3.9) < 0.2 * q(0, 0, 0.0), "{effects}: {} {}", q(0, 0, 3.9), q(0, 0, 0.0));
        let energy = made.energy.unwrap();
        let share = energy.largest_imbalance_j() / energy.initial_kinetic_j();
        assert!(share < 1e-9, "{effects}: {share}");
    }
}

const LINEAR: fn(f64) -> Closure = |closing_time_s| Closure::Linear { closing_time_s };

/// Area times discharge coefficient of a valve that passes `velocity_m_s` of a pipe at 40 m, mm².
fn cda_mm2(diameter_mm: f64, velocity_m_s: f64) -> f64 {
    velocity_m_s * std::f64::consts::FRAC_PI_4 * diameter_mm.powi(2) / (2.0 * GRAVITY_M_S2 * 40.0).sqrt()
}

fn other(cda_mm2: f64, closes: &str) -> String {
    format!("name = \"other\"; kind = \"valve\"; cda_mm2 = {cda_mm2}; discharge_head_m = 0.0; {closes}")
}

/// A tank, a tee and two equal branches, each with a valve.
fn twins(first: &str, second: &str) -> Rig {
    let pipes = [
        ("main", "tank", "tee", 90.0, 60.0, 1000.0),
        ("one", "tee", "valve", 47.0, 40.0, 800.0),
        ("two", "tee", "other", 47.0, 40.0, 800.0),
    ];
    rig(&[&TANK.replace("reservoir\"", "reservoir\"; head_m = 40.0"), TEE, first, second], &pipes, 0.0)
}

/// Two valves of a symmetric tee that close alike are one valve behind one pipe of twice the area.
#[test]
fn two_valves_that_close_alike_are_one_of_twice_the_flow() {
    let closes = "closing_time_s = 0.3; characteristic = [[0, 1], [0.4, 0.3], [1, 0]]";
    let first = format!("name = \"valve\"; kind = \"valve\"; {closes}");
    let two = twins(&first, &other(cda_mm2(40.0, 0.5), closes));
    let pipes =
        [("main", "tank", "tee", 90.0, 60.0, 1000.0), ("both", "tee", "valve", 47.0, 40.0 * 2f64.sqrt(), 800.0)];
    let one = rig(&[TANK, TEE, &first], &pipes, 0.0);
    let run = |values: &'static [f64]| Run { effects: "none", values, velocity_m_s: 0.5, reaches: 90, duration_s: 3.0 };
    let heads = [Probe::head(at(1, 47.0)), Probe::head(at(0, 45.0)), Probe::flow(at(0, 0.0)), Probe::head(at(2, 47.0))];
    let apart = run(&[0.3, 0.0]).closing(&two, &heads, false, LINEAR).traces;
    let whole = run(&[]).closing(&one, &heads[..3], false, LINEAR).traces;
    for (i, scale) in [40.0, 40.0, 1e-3].into_iter().enumerate() {
        let off = largest_difference(&apart[i], &whole[i], 3.0) / scale;
        assert!(off < 1e-9, "{i}: {off}");
    }
    assert!(largest_difference(&apart[3], &whole[0], 3.0) < 1e-9 * 40.0);
    // The other valve later: nothing but the first is seen until its wave comes.
    let later = run(&[0.3, 0.5]).closing(&two, &heads, false, LINEAR).traces;
    assert!(largest_difference(&later[3], &whole[0], 0.4) > 1.0);
}

/// What one valve does to the other, that one does to it where their names change places. Each is an orifice of its own
/// opening, and energy is accounted for.
#[test]
fn each_valve_has_its_own_time_law_and_start() {
    let (area, quick) = (cda_mm2(40.0, 0.5), "closing_time_s = 0.1");
    let rig = twins(&VALVE.replace("0.02", "0.2"), &other(area, quick));
    let probes = [at(1, 47.0), at(2, 47.0)].map(|place| [Probe::head(place), Probe::flow(place)]).concat();
    let run = |effects: &'static str, values: &'static [f64]| {
        let of = Run { effects, values, velocity_m_s: 0.5, reaches: 90, duration_s: 2.0 };
        of.closing(&rig, &probes, true, LINEAR)
    };
    // The closing time and start of the other, then the law.
    let made = [
        run("valve-law@valve", &[0.2, 0.0, 0.3, 0.8]),
        run("valve-law@other", &[0.2, 0.0, 0.3, 0.8]),
        run("valve-law/power@other,leak@one", &[0.13, 0.21, 2.0, 20.0, 8.0]),
    ];
    for i in 0..4 {
        let swapped = largest_difference(&made[0].traces[i], &made[1].traces[(i + 2) % 4], 2.0);
        assert!(swapped < 1e-9 * 40.0, "{i}: {swapped}");
    }
    assert!(largest_difference(&made[0].traces[0], &made[0].traces[2], 2.0) > 1.0);
    let [head, flow] = [2, 3].map(|i| &made[2].traces[i]);
    for (i, (h, q)) in head.values.iter().zip(&flow.values).enumerate() {
        let left = 1.0 - ((i as f64 * head.dt_s - 0.21) / 0.13).clamp(0.0, 1.0);
        let orifice = left.powi(2) * area * 1e-6 * (2.0 * GRAVITY_M_S2 * h.abs()).sqrt() * h.signum();
        assert!((q - orifice).abs() < 1e-12, "{i}: {q} {orifice}");
    }
    for made in &made {
        let energy = made.energy.as_ref().unwrap();
        let share = energy.largest_imbalance_j() / energy.initial_kinetic_j();
        assert!(share < 1e-9, "{share}");
    }
}

/// Where several valves close, a law says which one it means.
#[test]
fn a_law_of_the_valve_names_its_valve_where_several_close() {
    let rig =
        twins(VALVE, &other(9.0, "closing_time_s = 0.1; closing_start_s = 0.05; closing_time_tolerance_percent = 0"));
    let check = |effects: &str| check_places(&rig, &parse_list(effects).unwrap()).map_err(|e| e.to_string());
    let said = check("valve-law").unwrap_err();
    assert!(said.contains("several valves that close, valve, other") && said.contains("valve-law@valve"), "{said}");
    assert!(check("valve-seat-leak@third").unwrap_err().contains("there is no valve 'third' that closes"));
    assert_eq!((check("valve-law@other"), check("valve-seat-leak/stroke@valve")), (Ok(()), Ok(())));
    let model = Model::new(&rig, &rig.fluid.properties(20.0), &parse_list("valve-law@other").unwrap());
    let own: Vec<_> = model.shared[3..5].iter().map(|p| (p.name.as_str(), p.start, p.lower < p.upper)).collect();
    assert_eq!(own, [("closing_time_s[other]", 0.1, false), ("closing_start_s[other]", 0.05, true)]);
    assert_eq!(model.effects_from(), 5);
}
