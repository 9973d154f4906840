//! The scheme: heads at nodes, flows at the faces between them, leapfrogging half a step apart (Yee 1966; no
//! characteristics), every reach as long as a wave travels in a step. Friction, creep and gas enter each update
//! implicitly.

use super::forcing::{Forced, SupplyState};
use super::rig::{Case, Hidden};

const G: f64 = 9.81;
const NODES: usize = 400;
const ATMOSPHERE_M: f64 = 10.33;
pub const VAPOUR_M: f64 = -10.1;
/// Time that vapour takes to condense where the pressure is above its own. Without it, cavities of a few nodes collapse
/// one by one in spikes of the grid; with no more than a step of 400 nodes, 800 make another record by more than its
/// noise.
pub const CONDENSING_S: f64 = 2e-3;
/// Volume of the gas that starts a cavity, at the pressure of the air and per volume of pipe (Wylie 1984; Simpson &
/// Bergant 1994). Without any, water at vapour pressure yields without end, no wave evens out what the grid leaves there
/// from node to node, and records of ever finer grids hardly come nearer to each other.
pub const CAVITY_GAS: f64 = 1e-7;
/// Head above that of vapour from which this gas is dissolved.
const DISSOLVED_M: f64 = 1.0;
/// What counts as no cavity, m³: numbers that halve for ever end among those with which processors are slow.
const LEAST_M3: f64 = 1e-30;
/// Nodes where cavities open, whose records converge at first order.
const NODES_WITH_CAVITIES: usize = 1600;

/// A line of reaches: the pipe, or a branch.
struct Line {
    step_m: Vec<f64>,
    speed_m_s: Vec<f64>,
    head_m: Vec<f64>,
    flow_m3_s: Vec<f64>,
    strains: Vec<Vec<f64>>,
    kernel: Vec<Vec<f64>>,
    cavity_m3: Vec<f64>,
    gas_m3: Vec<f64>,
}

/// The wall: speed `u` at the faces and stress as a head `s` at the nodes, leapfrogging beside flow and head; the end
/// carries the valve on a spring.
struct Wall {
    poisson: f64,
    /// Head of stress per strain of a head of water, `ν D/2e`.
    hoop: f64,
    /// `g ρ/ρ_wall`, and `ct²` over it.
    by_stress: f64,
    by_strain: f64,
    /// Push of the water per head, and of the spring per travel, on the wall.
    push: f64,
    spring: f64,
    /// What dry friction on the floor takes of its speed while it slides, m/s².
    slows_m_s2: f64,
    speed_m_s: Vec<f64>,
    stress_m: Vec<f64>,
    travel_m: f64,
}

impl Wall {
    /// Of a case, with the speed of pressure waves in a wall that nothing moves, and how many steps stress waves ask of
    /// one of pressure waves.
    fn of(case: &Case, nodes: usize) -> Option<(Wall, f64, usize)> {
        let wall = |h: &Hidden| {
            if let Hidden::Wall(nu, ct, density, give, floor) = *h {
                Some((nu, ct, density, give, floor))
            } else {
                None
            }
        };
        let (poisson, ct, density_kg_m3, give, floor_m) = case.find(wall)?;
        let density = density_kg_m3 / case.density_kg_m3();
        let (ratio, a2) = (case.diameter_m / case.wall_m, case.wave_speed_m_s.powi(2));
        // (c² - a²)(ct² - a²) = 2ν² (ρ/ρ_wall)(D/2e) c² a², solved for c.
        let coupled = poisson * poisson * ratio * a2 / (density * (ct * ct - a2));
        let still_m_s = (a2 / (1.0 - coupled)).sqrt();
        let fast_m_s = still_m_s * ct / case.wave_speed_m_s;
        let wall = Wall {
            poisson,
            hoop: 0.5 * poisson * ratio,
            by_stress: G / density,
            by_strain: ct * ct * density / G,
            push: 0.25 * ratio,
            spring: 0.25 * ratio / give,
            slows_m_s2: G / density * 0.25 * ratio * floor_m / case.length_m,
            speed_m_s: vec![0.0; nodes],
            stress_m: vec![0.0; nodes + 1],
            travel_m: 0.0,
        };
        Some((wall, still_m_s, (1.1 * fast_m_s / case.wave_speed_m_s).ceil() as usize))
    }

    /// Mean rate of the end over a step in which its head deviates from `before` to `after`.
    fn end_rate(&self, before: f64, after: f64, step_m: f64, dt: f64) -> f64 {
        let stiffness = 2.0 * self.by_strain / step_m;
        let last = self.speed_m_s.len();
        let known =
            self.push * after - self.spring * self.travel_m - self.stress_m[last] - self.hoop * (after - before)
                + dt * stiffness * self.speed_m_s[last - 1];
        known / (dt * (self.spring + stiffness))
    }

    /// The head at a node before the end has risen.
    fn node(&mut self, i: usize, by_m: f64, step_m: &[f64], dt: f64) {
        let own = 0.5 * (step_m[i - 1] + step_m[i]);
        let gradient = (self.speed_m_s[i] - self.speed_m_s[i - 1]) / own;
        self.stress_m[i] += dt * self.by_strain * gradient + self.hoop * by_m;
        if i == 1 {
            // The supply's end does not move.
            self.stress_m[0] += dt * self.by_strain * self.speed_m_s[0] / (0.5 * step_m[0]);
        }
    }

    /// The head at the end has gone from one deviation to another.
    fn end(&mut self, before: f64, after: f64, step_m: f64, dt: f64) {
        let (rate, last) = (self.end_rate(before, after, step_m, dt), self.speed_m_s.len());
        let gradient = (rate - self.speed_m_s[last - 1]) / (0.5 * step_m);
        self.stress_m[last] += dt * self.by_strain * gradient + self.hoop * (after - before);
        self.travel_m += dt * rate;
    }
}

/// Beside a wall, pressure waves pass only a part of a reach in a step, and short ones would lag behind. What a node
/// stores therefore counts a little at its neighbours, `s (h + (1 - C²)/12 δ²h)`, which takes their error to fourth
/// order. Heads rise together: by elimination towards the end.
struct Sharp {
    /// `(1 - C²)/12`, with `C` the share of a reach.
    by_store: f64,
    /// What a node's store counts at the next one.
    off: f64,
    /// Diagonal and known part of each node before the end.
    rows: Vec<(f64, f64)>,
}

impl Sharp {
    /// A node whose balance is `value` at its old head and has this slope.
    fn node(&mut self, value: f64, slope: f64, store: f64) {
        self.off = self.by_store * store;
        let (of_last, known) = self.rows.last().map_or((0.0, 0.0), |(diagonal, known)| (self.off / diagonal, *known));
        self.rows.push((slope - self.off * (2.0 + of_last), -value - of_last * known));
    }

    /// What the nodes before the end add to its balance, as its head rises.
    fn end(&self, by_m: f64) -> f64 {
        self.rows.last().map_or(0.0, |(diagonal, known)| self.off * ((known - self.off * by_m) / diagonal - by_m))
    }

    /// How far the last of the nodes that are left rises, where the one behind it does so.
    fn rise(&mut self, behind_m: f64) -> f64 {
        self.rows.pop().map_or(0.0, |(diagonal, known)| (known - self.off * behind_m) / diagonal)
    }
}

/// Heads at places, m, every step from the start of the closure.
pub struct Solved {
    pub dt_s: f64,
    pub heads_m: Vec<Vec<f64>>,
    /// What a forcing does in each step from the start of the closure on, in its unit.
    pub forcing: Vec<f64>,
    /// Water in the pipe above what the steady heads hold, less what the supply has given, m³, every step. It stays the
    /// same where the valve is shut, nothing else lets water in or out, and the wall does not creep.
    #[cfg(test)]
    unaccounted_m3: Vec<f64>,
}

/// `1/√t` as a sum of exponentials: `∫ s^-½ e^-st ds / √π` by the trapezoidal rule in `ln s`, far enough for a
/// thousandth of its integral over one step.
fn inverse_root(shortest: f64) -> Vec<(f64, f64)> {
    let h = 0.7f64;
    let (low, high) = ((0.01f64).ln(), (3e5 / shortest).ln());
    let n = ((high - low) / h).ceil() as usize;
    (0..=n)
        .map(|j| {
            let s = (low + j as f64 * h).exp();
            (s, h * s.sqrt() / std::f64::consts::PI.sqrt())
        })
        .collect()
}

pub fn solve(case: &Case, velocity_m_s: f64, duration_s: f64) -> Solved {
    let nodes = if case.hidden.contains(&Hidden::Cavity) { NODES_WITH_CAVITIES } else { NODES };
    solve_on(case, velocity_m_s, duration_s, nodes)
}

pub fn solve_on(case: &Case, velocity_m_s: f64, duration_s: f64, nodes: usize) -> Solved {
    let area = case.area_m2();
    let flow0 = velocity_m_s * area;
    let section = |h: &Hidden| if let Hidden::Section(from, to, ratio) = *h { Some((from, to, ratio)) } else { None };
    let (from, to, ratio) = case.find(section).unwrap_or((0.0, 0.0, 1.0));
    let fast = |x: f64| if x >= from && x < to { case.wave_speed_m_s * ratio } else { case.wave_speed_m_s };
    // Reaches are even in travel time; the section's ends move to the nearest node.
    let travel_s = (case.length_m - (to - from)) / case.wave_speed_m_s + (to - from) / (case.wave_speed_m_s * ratio);
    let wall = Wall::of(case, nodes);
    let (still_m_s, parts) = wall.as_ref().map_or((case.wave_speed_m_s, 1), |(_, still, parts)| (*still, *parts));
    let mut wall = wall.map(|(wall, ..)| wall);
    let dt = travel_s / (nodes * parts) as f64;
    let (mut step_m, mut speed_m_s, mut x) = (Vec::new(), Vec::new(), 0.0);
    for _ in 0..nodes {
        let reach_s = dt * parts as f64;
        let a = fast(x + 0.5 * case.wave_speed_m_s * reach_s);
        step_m.push(a * reach_s);
        speed_m_s.push(a * still_m_s / case.wave_speed_m_s);
        x += a * reach_s;
    }
    let stretch = case.length_m / x;
    step_m.iter_mut().for_each(|s| *s *= stretch);
    speed_m_s.iter_mut().for_each(|a| *a *= stretch);
    let place: Vec<f64> = std::iter::once(0.0)
        .chain(step_m.iter().scan(0.0, |x, s| {
            *x += s;
            Some(*x)
        }))
        .collect();
    // Steady state, from the valve up.
    let nearest =
        |x_m: f64| (0..=nodes).min_by(|&a, &b| (place[a] - x_m).abs().total_cmp(&(place[b] - x_m).abs())).unwrap_or(0);
    // The hole is the same in every run, and so is the head.
    let leak = |h: &Hidden| if let Hidden::Leak(x, flow) = *h { Some((nearest(x), flow)) } else { None };
    let (leak_at, leak_flow) = case.find(leak).unwrap_or((0, 0.0));
    let blockage =
        |h: &Hidden| if let Hidden::Blockage(x, loss) = *h { Some((nearest(x).min(nodes - 1), loss)) } else { None };
    let (block_at, block_m) = case.find(blockage).unwrap_or((0, 0.0));
    let block_k = block_m / (case.velocity_m_s * area).powi(2);
    // The mouth's loss and the water outside belong to the first reach.
    let mouth =
        |h: &Hidden| if let Hidden::Mouth(loss, ratio, length) = *h { Some((loss, ratio, length)) } else { None };
    let (mouth_m, mouth_ratio, outside_m) = case.find(mouth).unwrap_or((0.0, 0.0, 0.0));
    let mouth_k = mouth_m / (case.velocity_m_s * area).powi(2);
    let f = case.friction_factor(velocity_m_s);
    let slope = |q: f64| f * q * q.abs() / (2.0 * G * case.diameter_m * area * area);
    let mut head = vec![case.valve_head_m; nodes + 1];
    let mut flow = vec![flow0; nodes];
    for i in (0..nodes).rev() {
        flow[i] = flow0 + if i < leak_at { leak_flow } else { 0.0 };
        head[i] = head[i + 1]
            + slope(flow[i]) * step_m[i]
            + if i == block_at { block_k * flow[i] * flow[i].abs() } else { 0.0 }
            + if i == 0 { mouth_k * flow[i] * flow[i].abs() } else { 0.0 };
    }
    let leak_k = if leak_at > 0 { leak_flow / head[leak_at].sqrt() } else { 0.0 };
    let cells_m = step_m.clone();
    let spread = case.find(|h| if let Hidden::Gas(fraction, lag_s) = *h { Some((fraction, lag_s)) } else { None });
    let (gas_fraction, gas_lag_s) = spread.unwrap_or_default();
    let gas = |at: usize, h: f64| {
        let own = 0.5 * (cells_m[at.min(nodes - 1)] + cells_m[at.max(1) - 1]) * area;
        gas_fraction * own * ATMOSPHERE_M / (h + ATMOSPHERE_M).max(0.05)
    };
    let air_m3 = case.find(|h| if let Hidden::Air(volume) = *h { Some(volume) } else { None }).unwrap_or(0.0);
    let air = |h: f64| air_m3 * ((case.valve_head_m + ATMOSPHERE_M) / (h + ATMOSPHERE_M).max(0.05)).powf(1.0 / 1.2);
    let gassy = spread.is_some();
    let steady = head.clone();
    let branch = |h: &Hidden| match *h {
        Hidden::Branch(x, length) => {
            Some((nearest(x), ((length / (case.wave_speed_m_s * dt)).round() as usize).max(1)))
        }
        _ => None,
    };
    let (branch_at, branch_cells) = case.find(branch).unwrap_or((0, 0));
    let mut branch =
        (vec![if branch_cells > 0 { head[branch_at] } else { 0.0 }; branch_cells + 1], vec![0.0; branch_cells]);
    let viscosity = case.viscosity_m2_s();
    let scaled_dt = 4.0 * viscosity * dt / case.diameter_m.powi(2);
    let reynolds = velocity_m_s * case.diameter_m / viscosity;
    let decay = reynolds.powf((15.29 / reynolds.powf(0.0567)).log10()) / 12.86;
    let roots: Vec<(f64, f64)> = if case.unsteady_friction {
        inverse_root(scaled_dt).into_iter().map(|(s, w)| (s + decay, w / (2.0 * std::f64::consts::PI.sqrt()))).collect()
    } else {
        Vec::new()
    };
    let shed: Vec<(f64, f64)> = roots
        .iter()
        .map(|(s, w)| ((-s * scaled_dt).exp(), w * (1.0 - (-s * scaled_dt).exp()) / (s * scaled_dt)))
        .collect();
    let weight: f64 = shed.iter().map(|(_, w)| w).sum();
    let constraint = 1.0;
    let modulus = constraint * case.diameter_m * case.density_kg_m3() * G / (2.0 * case.wall_m);
    let creep: Vec<(f64, f64, f64)> = case
        .creep
        .iter()
        .map(|(j, tau)| {
            let (r, e) = (dt / tau, (-dt / tau).exp());
            (e, modulus * j * (1.0 - (1.0 - e) / r), modulus * j * ((1.0 - e) / r - e))
        })
        .collect();
    let mut line = Line {
        strains: vec![vec![0.0; creep.len()]; nodes + 1],
        kernel: vec![vec![0.0; roots.len()]; nodes],
        cavity_m3: vec![0.0; nodes + 1],
        gas_m3: (0..=nodes).map(|i| gas(i, steady[i])).collect(),
        step_m,
        speed_m_s,
        head_m: head,
        flow_m3_s: flow,
    };
    // The moving end: travel and its rate.
    let moving = |h: &Hidden| match *h {
        Hidden::MovingValve(frequency, travel, damping) => {
            Some((std::f64::consts::TAU * frequency, travel / case.joukowsky_m(), damping))
        }
        _ => None,
    };
    let (omega, compliance, damping) = case.find(moving).unwrap_or((0.0, 0.0, 0.0));
    let (mut travel, mut rate) = (0.0, 0.0);
    let two_stage = case.find(|h| if let Hidden::TwoStage(ti, oi) = *h { Some((ti, oi)) } else { None });
    let seat_leak = case.find(|h| if let Hidden::SeatLeak(rest) = *h { Some(rest) } else { None }).unwrap_or(0.0);
    let forced = case.find(|h| if let Hidden::Forced(forced) = h { Some(forced.clone()) } else { None });
    let relief = match forced {
        Some(Forced::ReliefValve { at_m, above_m, root_c }) => Some((nearest(at_m), above_m, root_c)),
        _ => None,
    };
    let fed_at = forced.as_ref().and_then(|f| f.fed(0.0)).map(|(at_m, _)| nearest(at_m));
    let strains = matches!(forced, Some(Forced::NonlinearWall { .. }));
    let mut supply_state = SupplyState::still();
    let mut forcing = Vec::new();
    #[cfg(test)]
    let (mut given_m3, mut unaccounted_m3) = (0.0, Vec::new());
    let opening = |t: f64| {
        let s = (t / case.closing_s).clamp(0.0, 1.0);
        let law = match two_stage {
            Some((ti, oi)) if s < ti => 1.0 - (1.0 - oi) * s / ti,
            Some((ti, oi)) => oi * (1.0 - s) / (1.0 - ti),
            None => 1.0 - s,
        };
        // So is the gap under the seat, whatever the valve let through before.
        let rest = seat_leak * case.velocity_m_s / velocity_m_s;
        law * (1.0 - rest) + rest
    };
    let probes: Vec<(usize, f64)> = case
        .sensors_m
        .iter()
        .map(|&x| {
            let i = place.partition_point(|&p| p <= x).clamp(1, nodes) - 1;
            (i, ((x - place[i]) / (place[i + 1] - place[i])).clamp(0.0, 1.0))
        })
        .collect();
    let mut heads_m = vec![Vec::new(); probes.len()];
    let creeps = |strains: &mut [f64], before: f64, after: f64| {
        for (strain, (e, p1, p0)) in strains.iter_mut().zip(&creep) {
            *strain = *strain * e + p1 * after + p0 * before;
        }
    };
    let mut sharp = Sharp { by_store: (1.0 - (parts as f64).powi(-2)) / 12.0, off: 0.0, rows: Vec::new() };
    // A supply that swings has done so for long.
    let pulsates = case.hidden.iter().any(|h| matches!(h, Hidden::Pulsation(..)));
    let cavitates = case.hidden.contains(&Hidden::Cavity);
    let warm_up = if pulsates { (60.0 * travel_s / dt) as usize } else { 0 };
    let settle = if warm_up > 0 { (case.lead_s / dt).ceil() as usize } else { 0 };
    let steps = warm_up + settle + (duration_s / dt).ceil() as usize + 2;
    for n in 0..steps {
        let t = (n as f64 - (warm_up + settle) as f64) * dt;
        if n >= warm_up {
            for (probe, out) in probes.iter().zip(&mut heads_m) {
                out.push(line.head_m[probe.0] * (1.0 - probe.1) + line.head_m[probe.0 + 1] * probe.1);
            }
        }
        // Flows.
        for i in 0..nodes {
            let v = line.flow_m3_s[i] / area;
            let drive = G / line.step_m[i] * (line.head_m[i] - line.head_m[i + 1]);
            let held: f64 = line.kernel[i].iter().zip(&shed).map(|(y, (e, _))| 0.5 * y * (1.0 + e)).sum();
            let stress = 16.0 * viscosity / case.diameter_m.powi(2);
            let blocked_k = if i == block_at { block_k } else { 0.0 };
            // Losses go with the square of the step's mean velocity: second order, and a front finds them at their
            // place.
            let inertia = 1.0 + dt * stress * 0.5 * weight + if i == 0 { outside_m / line.step_m[0] } else { 0.0 };
            let sum = 2.0 * inertia * v + dt * (drive - stress * held);
            let local_k = match i {
                0 if sum < 0.0 => blocked_k + mouth_ratio * mouth_k,
                0 => blocked_k + mouth_k,
                _ => blocked_k,
            };
            let local = G * local_k * area * area / line.step_m[i];
            let square = dt * (f / (2.0 * case.diameter_m) + local);
            let mean = 2.0 * sum / (2.0 * inertia + (4.0 * inertia * inertia + 4.0 * square * sum.abs()).sqrt());
            let new = 2.0 * mean - v;
            for (y, (e, w)) in line.kernel[i].iter_mut().zip(&shed) {
                *y = *y * e + w * (new - v);
            }
            line.flow_m3_s[i] = new * area;
        }
        if let Some(wall) = &mut wall {
            for (i, u) in wall.speed_m_s.iter_mut().enumerate() {
                // Friction stops what it can within the step.
                let free = *u + dt * wall.by_stress * (wall.stress_m[i + 1] - wall.stress_m[i]) / line.step_m[i];
                *u = free.signum() * (free.abs() - dt * wall.slows_m_s2).max(0.0);
            }
        }
        for i in 0..branch_cells {
            let root = if i == 0 { line.head_m[branch_at] } else { branch.0[i] };
            branch.1[i] += G * area * dt / (case.wave_speed_m_s * dt) * (root - branch.0[i + 1]);
        }
        for i in 0..branch_cells {
            let out = if i + 1 < branch_cells { branch.1[i + 1] } else { 0.0 };
            let cell = case.wave_speed_m_s * dt * if i + 1 < branch_cells { 1.0 } else { 0.5 };
            branch.0[i + 1] += case.wave_speed_m_s.powi(2) * dt / (G * area * cell) * (branch.1[i] - out);
        }
        // Heads.
        let supply = |h: &Hidden| match *h {
            Hidden::Drift(change, tau) if t > 0.0 => change * (1.0 - (-(t + dt) / tau).exp()),
            Hidden::Pulsation(amplitude, hz) => amplitude * (std::f64::consts::TAU * hz * (t + dt)).sin(),
            _ => 0.0,
        };
        let own = forced.as_ref().map_or(0.0, |f| supply_state.head_m(f, line.flow_m3_s[0], flow0, t + dt, dt));
        let raised = case.hidden.iter().map(supply).sum::<f64>() + own;
        line.head_m[0] = steady[0] + raised;
        let mut of_step = raised;
        let end_m = line.head_m[nodes];
        for (i, &rest) in steady.iter().enumerate().skip(1) {
            let end = i == nodes;
            let right = if end { 0.0 } else { 0.5 * line.step_m[i] };
            let own = 0.5 * line.step_m[i - 1] + right;
            let store = G
                * area
                * (0.5 * line.step_m[i - 1] / line.speed_m_s[i - 1].powi(2)
                    + if end { 0.0 } else { right / line.speed_m_s[i].powi(2) });
            let old = line.head_m[i];
            let deviation = old - rest;
            // Creep takes 2 A Δx Δε: known part and what the new head adds.
            let mut known = 0.0;
            let mut grows = 0.0;
            for (strain, (e, p1, p0)) in line.strains[i].iter().zip(&creep) {
                known += (e - 1.0) * strain + p0 * deviation;
                grows += p1;
            }
            let branch_flow = if branch_cells > 0 && i == branch_at { branch.1[0] } else { 0.0 };
            let branch_store =
                if branch_cells > 0 && i == branch_at { 0.5 * G * area * dt / case.wave_speed_m_s } else { 0.0 };
            // The end's rate, as the mean over the step: the trapezoidal rule, as for the head.
            let swing = 0.5 * dt * omega * omega;
            let mean_rate = |mid: f64| {
                (rate + swing * (compliance * (mid - rest) - travel)) / (1.0 + 0.5 * dt * swing + damping * omega * dt)
            };
            let fed =
                forced.as_ref().filter(|_| fed_at == Some(i)).and_then(|f| f.fed(t + 0.5 * dt)).map_or(0.0, |f| f.1);
            let inflow = line.flow_m3_s[i - 1] - if end { 0.0 } else { line.flow_m3_s[i] } - branch_flow + fed;
            let touched = forced.as_ref().map_or(0.0, |f| f.opening(t + 0.5 * dt));
            let through = |mid: f64| flow0 * (mid.abs() / case.valve_head_m).sqrt() * mid.signum();
            let relieved = |mid: f64| match relief {
                Some((at, above_m, root_c)) if at == i => root_c * (mid - above_m).max(0.0).sqrt(),
                _ => 0.0,
            };
            let strained = |h: f64| forced.as_ref().map_or(0.0, |f| f.strain(h - rest));
            let old_strain = strained(old);
            // What the wall's speed takes in: Poisson's contraction, and at its end the valve that it carries.
            let taken = |h: f64| match &wall {
                None => 0.0,
                Some(wall) => {
                    let u = &wall.speed_m_s;
                    let right = if end { wall.end_rate(deviation, h - rest, line.step_m[i - 1], dt) } else { u[i] };
                    let moved = if end { right } else { 0.0 };
                    area * (moved - 2.0 * wall.poisson * (right - u[i - 1]))
                }
            };
            let old_gas = line.gas_m3[i];
            // Share of the way that a volume goes in a step towards the one that belongs to the new head.
            let way = |lag_s: f64| dt / (lag_s + dt);
            let new_gas = |h: f64| old_gas + way(gas_lag_s) * (gas(i, h) - old_gas);
            // What a cavity leaves where that is none.
            let way = way(CONDENSING_S);
            let left = line.cavity_m3[i] * (1.0 - way);
            let balance = |h: f64| {
                let mid = 0.5 * (h + old);
                let mut out = 0.0;
                if end {
                    let open = opening(t + 0.5 * dt);
                    out += (open + touched) * through(mid);
                    out += area * mean_rate(mid) + (air(old) - air(h)) / dt;
                }
                if leak_k > 0.0 && i == leak_at {
                    out += leak_k * mid.abs().sqrt() * mid.signum();
                }
                out += relieved(mid) + taken(h);
                line.cavity_m3[i] - left + (store + branch_store) * (h - old) + old_gas - new_gas(h)
                    + 2.0 * area * own * (known + grows * (h - rest) + strained(h) - old_strain)
                    - dt * (inflow - out)
            };
            // Without gas, a hole or the valve the balance is linear: one step of Newton's is the answer.
            let is_relieved = relief.is_some_and(|(at, ..)| at == i);
            let linear = !(gassy || end || strains || is_relieved || (leak_k > 0.0 && i == leak_at));
            let slight = if linear { 1.0 } else { 1e-6 };
            if wall.is_some() && !end {
                sharp.node(balance(old), balance(old + 1.0) - balance(old), store);
                continue;
            }
            let mut h = old;
            for _ in 0..if linear { 1 } else { 30 } {
                let value = balance(h) + sharp.end(h - old);
                let d = (balance(h + slight) + sharp.end(h + slight - old) - value) / slight;
                let step = if linear { -value / d } else { (-value / d).clamp(-50.0, 50.0) };
                h += step;
                if step.abs() < 1e-9 {
                    break;
                }
            }
            // Where there is gas, the balance is linear. What the cavity holds follows from the water, so that none is lost.
            if cavitates {
                let content = way * CAVITY_GAS * ATMOSPHERE_M * area * own;
                let at_vapour = balance(VAPOUR_M);
                let slope = balance(VAPOUR_M + 1.0) - at_vapour;
                let b = at_vapour + content / DISSOLVED_M;
                let root = (b * b + 4.0 * slope * content).sqrt() + b.abs();
                let above = if b > 0.0 { 2.0 * content / root } else { 0.5 * root / slope };
                let boils = above < DISSOLVED_M;
                h = if boils { VAPOUR_M + above } else { h };
                let cavity = left + if boils { balance(h) } else { 0.0 };
                line.cavity_m3[i] = if cavity < LEAST_M3 { 0.0 } else { cavity };
            }
            if end {
                let mean = mean_rate(0.5 * (h + old));
                travel += dt * mean;
                rate = 2.0 * mean - rate;
            }
            creeps(&mut line.strains[i], deviation, h - rest);
            if let Some(wall) = &mut wall {
                wall.end(deviation, h - rest, line.step_m[i - 1], dt);
            }
            let mid = 0.5 * (h + old);
            of_step += relieved(mid) - fed + if end { touched * through(mid) + strained(h) } else { 0.0 };
            line.gas_m3[i] = new_gas(h);
            line.head_m[i] = h;
        }
        if let Some(wall) = &mut wall {
            let mut behind_m = line.head_m[nodes] - end_m;
            for i in (1..nodes).rev() {
                let before = line.head_m[i] - steady[i];
                behind_m = sharp.rise(behind_m);
                line.head_m[i] += behind_m;
                creeps(&mut line.strains[i], before, before + behind_m);
                wall.node(i, behind_m, &line.step_m, dt);
            }
        }
        if n >= warm_up + settle {
            forcing.push(of_step);
        }
        #[cfg(test)]
        {
            given_m3 += dt * line.flow_m3_s[0];
            let held = (1..=nodes).map(|i| {
                let (left, right) = (line.step_m[i - 1], if i == nodes { 0.0 } else { line.step_m[i] });
                let store = 0.5 * G * area * (left + right) / line.speed_m_s[i - 1].powi(2);
                store * (line.head_m[i] - steady[i]) - line.cavity_m3[i]
            });
            unaccounted_m3.push(held.sum::<f64>() - given_m3);
        }
    }
    // A valve that shuts leaves heads that ring from one step to the next, which no pipe does: the mean of neighbours
    // is still.
    for heads in &mut heads_m {
        let rung = heads.clone();
        for (i, head) in heads.iter_mut().enumerate().take(rung.len() - 1).skip(1) {
            *head = 0.25 * (rung[i - 1] + 2.0 * rung[i] + rung[i + 1]);
        }
    }
    Solved {
        dt_s: dt,
        heads_m,
        forcing,
        #[cfg(test)]
        unaccounted_m3,
    }
}

#[cfg(test)]
mod tests {
    use super::super::record::linear;
    use super::*;

    /// At the case's 20 °C.
    const WATER_KG_M3: f64 = 998.2;

    /// A frictionless-looking elastic pipe: 100 m, 400 m/s, one second a period.
    fn case(hidden: Option<Hidden>, creep: Vec<(f64, f64)>) -> Case {
        Case {
            name: String::new(),
            material: "HDPE",
            length_m: 100.0,
            diameter_m: 0.5,
            wall_m: 0.05,
            wave_speed_m_s: 400.0,
            temperature_c: 20.0,
            velocity_m_s: 0.2,
            second_velocity_m_s: None,
            valve_head_m: 30.0,
            closing_s: 0.02,
            duration_s: 6.0,
            lead_s: 0.5,
            sample_s: 0.001,
            sensors_m: vec![100.0],
            noise_m: 0.01,
            creep,
            friction: None,
            unsteady_friction: false,
            start_effects: Vec::new(),
            hidden: hidden.into_iter().collect(),
        }
    }

    fn at(solved: &Solved, t: f64) -> f64 {
        solved.heads_m[0][(t / solved.dt_s).round() as usize]
    }

    #[test]
    fn a_quick_closure_gives_joukowskys_head_and_the_period() {
        let case = case(None, Vec::new());
        let solved = solve(&case, case.velocity_m_s, case.duration_s);
        for (t, sign) in [(0.25, 1.0), (0.75, -1.0), (1.25, 1.0), (5.75, -1.0)] {
            let rise = at(&solved, t) - case.valve_head_m;
            assert!((rise * sign / case.joukowsky_m() - 1.0).abs() < 0.015, "{rise} at {t} s");
        }
    }

    #[test]
    fn a_little_creep_damps_as_theory_says() {
        // Logarithmic decrement of a weakly creeping pipe's ground mode: π F J ωτ/(1 + ω²τ²), F = a² ρ D/e.
        let (j, tau) = (4e-12, 0.15);
        let mut case = case(Some(Hidden::Creep), vec![(j, tau)]);
        case.closing_s = 1.0;
        let solved = solve(&case, case.velocity_m_s, case.duration_s);
        let w = std::f64::consts::TAU / 1.0;
        let factor = case.wave_speed_m_s.powi(2) * 1000.0 * case.diameter_m / case.wall_m;
        let decrement = std::f64::consts::PI * factor * j * w * tau / (1.0 + (w * tau).powi(2));
        // The ground mode alone, by its Fourier sum over one period after the other.
        let mode = |from: f64| {
            let (mut c, mut s) = (0.0, 0.0);
            for i in 0..1000 {
                let t = from + f64::from(i) * 1e-3;
                let h = at(&solved, t) - case.valve_head_m;
                c += h * (w * t).cos();
                s += h * (w * t).sin();
            }
            c.hypot(s)
        };
        let seen = (mode(1.5) / mode(4.5)).ln() / 3.0;
        assert!((seen / decrement - 1.0).abs() < 0.1, "{seen} against {decrement}");
    }

    #[test]
    fn a_leak_lowers_the_first_plateau_behind_it() {
        let flow = 0.05 * case(None, Vec::new()).area_m2() * 0.2;
        let leaking = case(Some(Hidden::Leak(50.0, flow)), Vec::new());
        let solved = solve(&leaking, 0.2, 1.0);
        // The wave that passes an orifice raises its flow; the head behind falls by half a/(gA) times what it takes
        // more.
        let rise = leaking.joukowsky_m();
        let impedance = leaking.wave_speed_m_s / (G * leaking.area_m2());
        let mut head = leaking.valve_head_m + rise;
        for _ in 0..50 {
            head = leaking.valve_head_m + rise - 0.5 * impedance * flow * ((head / leaking.valve_head_m).sqrt() - 1.0);
        }
        let fall = leaking.valve_head_m + rise - head;
        let sound = solve(&case(None, Vec::new()), 0.2, 1.0);
        let seen = at(&sound, 0.4) - at(&solved, 0.4);
        // What comes back to the closed valve doubles there.
        assert!((seen / (2.0 * fall) - 1.0).abs() < 0.05, "{seen} against {}", 2.0 * fall);
    }

    /// What a pump feeds in sends a wave of half `a q/(gA)` either way, which doubles at the closed valve; a relief
    /// valve there takes out what its law says.
    #[test]
    fn forcings_send_the_waves_that_theory_says() {
        let sound = solve(&case(None, Vec::new()), 0.2, 1.0);
        let flow = 0.03 * 0.2 * case(None, Vec::new()).area_m2();
        let pump = Forced::SecondPump { at_m: 50.0, flow_m3_s: flow, from_s: 0.0, tau_s: 0.005, share: 0.0, hz: 1.0 };
        let fed = solve(&case(Some(Hidden::Forced(pump)), Vec::new()), 0.2, 1.0);
        let impedance = 400.0 / (G * case(None, Vec::new()).area_m2());
        let seen = at(&fed, 0.25) - at(&sound, 0.25);
        assert!((seen / (impedance * flow) - 1.0).abs() < 0.05, "{seen} against {}", impedance * flow);
        let root_c = 0.05 * flow;
        let relief = Forced::ReliefValve { at_m: 50.0, above_m: 33.0, root_c };
        let relieved = solve(&case(Some(Hidden::Forced(relief)), Vec::new()), 0.2, 1.0);
        let most = relieved.forcing.iter().copied().fold(0.0, f64::max);
        let head = case(None, Vec::new()).valve_head_m + case(None, Vec::new()).joukowsky_m();
        assert!((most / (root_c * (head - 33.0).sqrt()) - 1.0).abs() < 0.1, "{most}");
        assert!(relieved.forcing[0] == 0.0 && sound.forcing.iter().all(|v| *v == 0.0));
    }

    /// From grids of which each has three reaches for one of the last: the middle of a reach stays the middle of one.
    fn order_of(hidden: Hidden) -> f64 {
        let mut case = case(Some(hidden), Vec::new());
        case.closing_s = 0.1;
        let at_valve = |nodes: usize| {
            let solved = solve_on(&case, 0.2, 3.0, nodes);
            (0..100).map(|i| linear(&solved.heads_m[0], (f64::from(i) + 0.5) * 0.025 / solved.dt_s)).collect::<Vec<_>>()
        };
        let apart = |a: &[f64], b: &[f64]| (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 100.0).sqrt();
        let (coarse, medium, fine) = (at_valve(40), at_valve(120), at_valve(360));
        (apart(&coarse, &medium) / apart(&medium, &fine)).ln() / 3.0f64.ln()
    }

    /// A front's corners cost half an order.
    #[test]
    fn a_moving_end_and_losses_converge() {
        for (hidden, least) in [
            (Hidden::MovingValve(2.3, 0.004, 0.05), 1.8),
            (Hidden::Blockage(51.249, 2.0), 1.4),
            (Hidden::Mouth(1.0, 0.3, 2.0), 0.9),
        ] {
            let named = format!("{hidden:?}");
            let order = order_of(hidden);
            assert!(order > least, "{named}: order {order}");
        }
    }

    /// Against what one characteristic and the loss say at each return of the wave to the supply (Contractor 1965): the
    /// shut pipe at rest has the head `h`, `B q + k q|q|` of which a flow `q` out of it takes.
    #[test]
    fn a_mouth_weakens_the_wave_at_each_return() {
        let (loss_m, ratio) = (1.0, 0.3);
        let case = case(Some(Hidden::Mouth(loss_m, ratio, 0.0)), Vec::new());
        let solved = solve(&case, case.velocity_m_s, case.duration_s);
        let speed = 400.0 / G;
        let mut over_m = speed * 0.2 - loss_m;
        for (i, t) in [0.25, 0.75, 1.25, 1.75, 2.25].into_iter().enumerate() {
            let seen = at(&solved, t) - case.valve_head_m - loss_m;
            // Friction is in the scheme, too: a thousandth of the wave at each pass.
            assert!((seen - over_m).abs() < 0.015 * case.joukowsky_m(), "plateau {i}: {seen} against {over_m}");
            let k = loss_m / 0.04 * if over_m > 0.0 { ratio } else { 1.0 };
            let out = 2.0 * over_m / (speed + (speed * speed + 4.0 * k * over_m.abs()).sqrt());
            over_m -= 2.0 * speed * out;
        }
        assert!(over_m.abs() < 0.9 * case.joukowsky_m(), "the case shows the loss: {over_m}");
    }

    /// A wall whose valve is held by next to nothing: water and wall stop each other as their impedances say, and the
    /// head ahead of the pressure wave's return is that of the wall's first echo.
    #[test]
    fn a_wall_that_moves_answers_as_its_impedance_says() {
        let hidden = Hidden::Wall(1e-6, 1500.0, 2.0 * WATER_KG_M3, 1e6, 0.0);
        let moving = Case { wall_m: 0.025, ..case(Some(hidden), Vec::new()) };
        let solved = solve(&moving, moving.velocity_m_s, 1.0);
        // ρ A a (V - u) = ρ A g h and A ρ g h = ρ_w A_w ct u, until the wall's echo is back after 2L/ct.
        let mass = 2.0 * 4.0 * moving.wall_m / moving.diameter_m;
        let share = 1.0 / (1.0 + 400.0 / (mass * 1500.0));
        let seen = (at(&solved, 0.1) - moving.valve_head_m) / moving.joukowsky_m();
        assert!((seen / share - 1.0).abs() < 0.02, "{seen} against {share}");
        // Anchored at the supply, the wall pulls back: what it moves after two more travel times is the negative.
        let back = share + 2.0 * (1.0 - share) * share;
        let seen = (at(&solved, 0.2) - moving.valve_head_m) / moving.joukowsky_m();
        assert!((seen - back).abs() < 0.02, "{seen} against {back}");
    }

    /// Held all along, a wall changes nothing, though pressure waves then take several steps for a reach: they keep their
    /// shape over eight passes.
    #[test]
    fn waves_beside_a_wall_that_stands_still_are_those_without_one() {
        let at_valve = |hidden| {
            let case = Case { closing_s: 0.1, ..case(hidden, Vec::new()) };
            let solved = solve(&case, case.velocity_m_s, 2.0);
            (0..80).map(|i| linear(&solved.heads_m[0], (f64::from(i) + 0.5) * 0.025 / solved.dt_s)).collect::<Vec<_>>()
        };
        let (still, none) = (at_valve(Some(Hidden::Wall(1e-6, 1500.0, 4.0 * WATER_KG_M3, 1e-9, 0.0))), at_valve(None));
        let apart = (still.iter().zip(&none).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / 80.0).sqrt();
        let rise = case(None, Vec::new()).joukowsky_m();
        assert!(apart < 1e-3 * rise, "{apart} m of {rise}");
    }

    /// Ahead of the pressure wave of an anchored valve that shuts runs the stress wave that holds the wall's end still:
    /// `u = 0` and `V = -V0` there, with one wave of each kind (Tijsseling 2003).
    #[test]
    fn poissons_precursor_is_as_high_as_theory_says() {
        let (nu, ct, density) = (0.5, 1500.0, 2.0);
        let hidden = Hidden::Wall(nu, ct, density * WATER_KG_M3, 1e-9, 0.0);
        let sensors_m = vec![100.0, 50.0];
        let case = Case { wall_m: 0.025, closing_s: 0.005, sensors_m, ..case(Some(hidden), Vec::new()) };
        let solved = solve(&case, case.velocity_m_s, 0.3);
        let (a2, ct2, ratio) = (400.0f64.powi(2), ct * ct, case.diameter_m / case.wall_m);
        let still2 = a2 / (1.0 - nu * nu * ratio * a2 / (density * (ct2 - a2)));
        let fast = (still2 * ct2 / a2).sqrt();
        let alpha = 0.5 * nu * ratio * a2 / (ct2 - a2);
        let beta = 2.0 * nu / density / (fast * fast / still2 - 1.0);
        let rise = case.joukowsky_m() / (1.0 + alpha * beta);
        let ahead = alpha * beta * fast / 400.0 * rise;
        // Means over what passes between two fronts: the pressure wave is at the middle after 0.125 s.
        let mean = |sensor: usize, from: f64, to: f64| {
            let steps = (from / solved.dt_s) as usize..(to / solved.dt_s) as usize;
            solved.heads_m[sensor][steps.clone()].iter().sum::<f64>() / steps.len() as f64 - case.valve_head_m
        };
        let seen = mean(1, 0.045, 0.09);
        assert!((seen / ahead - 1.0).abs() < 0.01, "{seen} against {ahead} of {rise} m");
        let seen = mean(0, 0.02, 0.1);
        assert!((seen / (rise + ahead) - 1.0).abs() < 0.005, "{seen} against {}", rise + ahead);
    }

    /// Gas that follows the pressure late: the head that stops a flow is at first what the liquid alone makes it, then
    /// falls to that of liquid and gas. Its Laplace transform is that of the liquid times `√((s + α)/(s + β))`,
    /// `α = 1/τ`, `β = α (1 + r)`, for `r` the compliance of the gas over that of the liquid; that of
    /// `e^(-(α + β)t/2) I₀((β - α)t/2)` is `1/√((s + α)(s + β))` (Abramowitz & Stegun 29.3.49).
    #[test]
    fn gas_that_lags_answers_as_its_relaxation_says() {
        let (fraction, lag_s) = (0.01, 0.05);
        let hidden = Some(Hidden::Gas(fraction, lag_s));
        let case = Case { velocity_m_s: 0.002, closing_s: 0.002, ..case(hidden, Vec::new()) };
        let solved = solve(&case, case.velocity_m_s, 0.5);
        let absolute_m = case.valve_head_m + ATMOSPHERE_M;
        let ratio = fraction * ATMOSPHERE_M / absolute_m.powi(2) * case.wave_speed_m_s.powi(2) / G;
        let (alpha, beta) = (1.0 / lag_s, (1.0 + ratio) / lag_s);
        let bessel = |x: f64| {
            let terms = (1..40).scan(1.0, |term, k| {
                *term *= (0.5 * x / f64::from(k)).powi(2);
                Some(*term)
            });
            1.0 + terms.sum::<f64>()
        };
        let kernel = |t: f64| (-0.5 * (alpha + beta) * t).exp() * bessel(0.5 * (beta - alpha) * t);
        let (mut passed_s, mut integral, step_s) = (0.0, 0.0, 1e-4);
        // until the wave is back from the supply
        for t in [0.02, 0.05, 0.1, 0.2, 0.4] {
            while passed_s < t - 0.5 * step_s {
                integral += step_s * kernel(passed_s + 0.5 * step_s);
                passed_s += step_s;
            }
            let exact = kernel(t) + alpha * integral;
            // the middle of the closure is its time
            let seen = (at(&solved, t + 0.5 * case.closing_s) - case.valve_head_m) / case.joukowsky_m();
            assert!((seen - exact).abs() < 0.005, "{seen} against {exact} at {t} s");
        }
    }

    /// A surge that boils the water along the pipe again and again.
    #[test]
    fn cavities_lose_and_make_no_water() {
        let boiling = Case { velocity_m_s: 1.0, closing_s: 0.1, ..case(Some(Hidden::Cavity), Vec::new()) };
        let solved = solve(&boiling, boiling.velocity_m_s, boiling.duration_s);
        let shut = (boiling.closing_s / solved.dt_s).ceil() as usize + 2;
        let (first, last) = solved.unaccounted_m3[shut..]
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (v.min(a), v.max(b)));
        let lowest = solved.heads_m[0].iter().copied().fold(f64::INFINITY, f64::min);
        assert!((0.0..0.01).contains(&(lowest - VAPOUR_M)), "the valve's head falls to {lowest} m");
        // What the closure presses into the pipe.
        let pressed = boiling.length_m / boiling.wave_speed_m_s * boiling.velocity_m_s * boiling.area_m2();
        assert!(last - first < 1e-6 * pressed, "{} of {pressed} m³", last - first);
    }

    #[test]
    fn a_plateau_is_still_where_the_surge_is_far_above_the_head() {
        let case = Case { valve_head_m: 3.3, closing_s: 0.1103, ..case(None, Vec::new()) };
        let solved = solve(&case, case.velocity_m_s, case.duration_s);
        let plateau = &solved.heads_m[0][200..700];
        let rings = plateau.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
        assert!(rings < 1e-4 * case.joukowsky_m(), "{rings} m of {}", case.joukowsky_m());
    }
}
