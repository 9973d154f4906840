//! Pipes in series that move, by the exact recursion back along characteristics (Tijsseling 2003, J. Fluids Struct.
//! 18:179-196, for one pipe): the four equations as they stand in the literature, in pressures and stresses, with waves
//! found numerically. At a joint of two pipes P, u, A (V - u) and A_w σ - A P are continuous.

use std::cell::RefCell;
use std::collections::HashMap;

use nalgebra::{DMatrix, Matrix4, RowVector4, Vector4};

pub(crate) const G: f64 = 9.81;
/// Pressures and stresses in MPa keep the matrices well scaled.
const MPA: f64 = 1e6;
/// Times this near to each other are one, s.
const SAME_S: f64 = 1e-12;

/// A pipe with its water; lengths in m, moduli in Pa, densities in kg/m³.
#[derive(Clone, Copy)]
pub(crate) struct Pipe {
    pub(crate) length: f64,
    pub(crate) diameter: f64,
    pub(crate) wall: f64,
    pub(crate) modulus: f64,
    pub(crate) wall_density: f64,
    pub(crate) poisson: f64,
    pub(crate) bulk: f64,
    pub(crate) density: f64,
}

/// What holds an end: it does not move, or the valve's end is free and closed, the supply's free and open.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Held {
    Anchored,
    Free,
}

/// Waves of a pipe.
struct Waves {
    pipe: Pipe,
    /// Downstream slow and fast, upstream slow and fast.
    speeds: [f64; 4],
    shapes: Matrix4<f64>,
    /// Coefficients of the derivatives by time.
    by_time: Matrix4<f64>,
}

impl Pipe {
    pub(crate) fn area(&self) -> f64 {
        0.25 * std::f64::consts::PI * self.diameter.powi(2)
    }

    fn wall_area(&self) -> f64 {
        std::f64::consts::PI * self.diameter * self.wall
    }

    /// Speeds of its slow and its fast waves, m/s.
    pub(crate) fn speeds(&self) -> [f64; 2] {
        let [slow, fast, ..] = Waves::of(*self).speeds;
        [slow, fast]
    }
}

impl Waves {
    #[rustfmt::skip]
    fn of(pipe: Pipe) -> Waves {
        let Pipe { diameter: d, wall: e, modulus, wall_density, poisson: nu, bulk, density, .. } = pipe;
        let by_time = Matrix4::new(
            1.0, 0.0, 0.0, 0.0,
            0.0, MPA * (1.0 / bulk + d / (modulus * e)), 0.0, -MPA * 2.0 * nu / modulus,
            0.0, 0.0, 1.0, 0.0,
            0.0, MPA * nu * d / (2.0 * modulus * e), 0.0, -MPA / modulus,
        );
        let by_place = Matrix4::new(
            0.0, MPA / density, 0.0, 0.0,
            1.0, 0.0, 0.0, 0.0,
            0.0, 0.0, 0.0, -MPA / wall_density,
            0.0, 0.0, 1.0, 0.0,
        );
        let flux = by_time.try_inverse().unwrap() * by_place;
        let mut speeds: Vec<f64> = flux.eigenvalues().unwrap().iter().copied().collect();
        speeds.sort_by(|a, b| (*a < 0.0, a.abs()).partial_cmp(&(*b < 0.0, b.abs())).unwrap());
        let speeds = [speeds[0], speeds[1], speeds[2], speeds[3]];
        let shape = |speed: f64| {
            let svd = (flux - Matrix4::identity() * speed).svd(false, true);
            let least = (0..4).min_by(|a, b| svd.singular_values[*a].total_cmp(&svd.singular_values[*b])).unwrap();
            Vector4::from_iterator(svd.v_t.unwrap().row(least).iter().copied())
        };
        Waves { pipe, speeds, shapes: Matrix4::from_columns(&speeds.map(shape)), by_time }
    }

    /// Energy of water and wall per metre, J/m: the time's matrix is symmetric once its rows are forces and flows.
    fn energy(&self, state: &Vector4<f64>) -> f64 {
        let (water, wall) = (self.pipe.area(), self.pipe.wall_area());
        let rows = [self.pipe.density * water, MPA * water, self.pipe.wall_density * wall, -MPA * wall];
        0.5 * state.dot(&(Matrix4::from_diagonal(&Vector4::from(rows)) * self.by_time * state))
    }
}

/// The supply, a joint or the valve: what its laws make of the waves that arrive.
struct Node {
    /// Pipes before it and behind it.
    sides: [Option<usize>; 2],
    /// Waves that leave, upstream ones first, for those that arrive, downstream ones first.
    sends: DMatrix<f64>,
    /// The same for the right side of its first law.
    given: DMatrix<f64>,
}

impl Node {
    fn new(before: Option<(usize, &Waves)>, behind: Option<(usize, &Waves)>, held: Held) -> Node {
        let laws = |waves: &Waves| -> Vec<RowVector4<f64>> {
            let (area, wall) = (waves.pipe.area(), waves.pipe.wall_area());
            let pressure = RowVector4::new(0.0, 1.0, 0.0, 0.0);
            let velocity = RowVector4::new(0.0, 0.0, 1.0, 0.0);
            let flow = RowVector4::new(area, 0.0, -area, 0.0);
            let force = RowVector4::new(0.0, -area, 0.0, wall);
            match (before, behind, held) {
                (Some(_), Some(_), _) => vec![flow, pressure, velocity, force],
                (None, _, Held::Anchored) => vec![pressure, velocity],
                (None, _, Held::Free) => vec![pressure, force],
                (_, None, Held::Anchored) => vec![flow, velocity],
                (_, None, Held::Free) => vec![flow, force],
            }
        };
        // Columns of the waves from `first` on of each pipe there is; a joint's laws are differences.
        let of = |side: Option<(usize, &Waves)>, first: usize, sign: f64| -> Vec<Vec<f64>> {
            let Some((_, waves)) = side else { return Vec::new() };
            let column = |k: usize| laws(waves).iter().map(|law| sign * (law * waves.shapes.column(k))[0]).collect();
            vec![column(first), column(first + 1)]
        };
        let matrix = |columns: Vec<Vec<f64>>| {
            DMatrix::from_iterator(columns[0].len(), columns.len(), columns.into_iter().flatten())
        };
        let leave = matrix([of(before, 2, 1.0), of(behind, 0, -1.0)].concat()).try_inverse().unwrap();
        let arrive = matrix([of(before, 0, 1.0), of(behind, 2, -1.0)].concat());
        let given = leave.columns(0, 1).into_owned();
        Node { sides: [before, behind].map(|side| side.map(|(k, _)| k)), sends: -(leave * arrive), given }
    }
}

/// The exact solution for a valve that closes from time 0 on, in deviations (V, P, u, σ) from the steady flow.
pub(crate) struct Exact {
    waves: Vec<Waves>,
    nodes: Vec<Node>,
    pub(crate) held: [Held; 2],
    /// Velocity before, in the pipe at the valve.
    pub(crate) velocity: f64,
    /// Share of the flow that is stopped by a time.
    closed: fn(f64) -> f64,
    /// What left a node, upstream first, at a time.
    known: RefCell<HashMap<(usize, i64), Vec<f64>>>,
}

impl Exact {
    /// Closed at once.
    pub(crate) fn new(pipes: &[Pipe], held: [Held; 2], velocity: f64) -> Exact {
        let waves: Vec<Waves> = pipes.iter().map(|pipe| Waves::of(*pipe)).collect();
        let side = |k: usize| waves.get(k).map(|own| (k, own));
        let node = |n: usize| Node::new(n.checked_sub(1).and_then(side), side(n), held[usize::from(n == waves.len())]);
        let nodes = (0..=waves.len()).map(node).collect();
        Exact { waves, nodes, held, velocity, closed: |_| 1.0, known: RefCell::default() }
    }

    /// The same with another closure.
    pub(crate) fn closing(self, closed: fn(f64) -> f64) -> Exact {
        Exact { closed, ..self }
    }

    pub(crate) fn pipes(&self) -> impl Iterator<Item = Pipe> {
        self.waves.iter().map(|waves| waves.pipe)
    }

    pub(crate) fn length(&self) -> f64 {
        self.pipes().map(|pipe| pipe.length).sum()
    }

    /// Speed of the pressure waves in each pipe, m/s.
    pub(crate) fn slow_speeds(&self) -> Vec<f64> {
        self.waves.iter().map(|waves| waves.speeds[0]).collect()
    }

    /// Time for a pressure wave from one end to the other, s.
    pub(crate) fn travel_s(&self) -> f64 {
        self.waves.iter().map(|waves| waves.pipe.length / waves.speeds[0]).sum()
    }

    /// Amplitudes of the waves that leave a node (0: supply, last: valve) at a time, upstream first.
    fn leaving(&self, node: usize, t: f64) -> Vec<f64> {
        let Node { sides, sends, given } = &self.nodes[node];
        if t < 0.0 {
            return vec![0.0; sends.nrows()];
        }
        let key = (node, (t / SAME_S).round() as i64);
        if let Some(known) = self.known.borrow().get(&key) {
            return known.clone();
        }
        let mut arriving = Vec::with_capacity(sends.ncols());
        for (pipe, from) in [(sides[0], node.wrapping_sub(1)), (sides[1], node + 1)] {
            let Some(pipe) = pipe else { continue };
            for k in [0, 1] {
                let sent = self.leaving(from, t - self.waves[pipe].pipe.length / self.waves[pipe].speeds[k]);
                // Of the neighbour's waves, those into this pipe: its last two if it lies before this node.
                arriving.push(if from < node { sent[sent.len() - 2 + k] } else { sent[k] });
            }
        }
        let valve = node + 1 == self.nodes.len();
        let stopped = if valve { -self.velocity * self.waves[node - 1].pipe.area() * (self.closed)(t) } else { 0.0 };
        let leaving = sends * DMatrix::from_vec(arriving.len(), 1, arriving) + given * stopped;
        let leaving: Vec<f64> = leaving.iter().copied().collect();
        self.known.borrow_mut().insert(key, leaving.clone());
        leaving
    }

    /// (V, P, u, σ) at a distance from the beginning of a pipe.
    fn state(&self, k: usize, x: f64, t: f64) -> Vector4<f64> {
        let Waves { pipe, speeds, shapes, .. } = &self.waves[k];
        let mut state = Vector4::zeros();
        for i in [0, 1] {
            let down = self.leaving(k, t - x / speeds[i]);
            let up = self.leaving(k + 1, t - (pipe.length - x) / speeds[i]);
            state += shapes.column(i) * down[down.len() - 2 + i] + shapes.column(i + 2) * up[i];
        }
        state
    }

    /// Head over that of the steady flow at a distance from the supply, m.
    pub(crate) fn head_m(&self, x: f64, t: f64) -> f64 {
        let mut start = 0.0;
        let last = self.waves.len() - 1;
        for (k, pipe) in self.pipes().enumerate() {
            if x <= start + pipe.length || k == last {
                return self.state(k, x - start, t)[1] * MPA / (pipe.density * G);
            }
            start += pipe.length;
        }
        f64::NAN
    }

    /// Energy of water and walls, J, by the midpoints of so many cells in each pipe.
    pub(crate) fn energy_j(&self, t: f64, cells: &[usize]) -> f64 {
        let of = |(k, &cells): (usize, &usize)| {
            let cell = self.waves[k].pipe.length / cells as f64;
            (0..cells).map(|i| cell * self.waves[k].energy(&self.state(k, (i as f64 + 0.5) * cell, t))).sum::<f64>()
        };
        cells.iter().enumerate().map(of).sum()
    }

    /// Velocity of the wall and its axial stress at the valve, m/s and MPa.
    pub(crate) fn wall_at_valve(&self, t: f64) -> [f64; 2] {
        let k = self.waves.len() - 1;
        let state = self.state(k, self.waves[k].pipe.length, t);
        [state[2], state[3]]
    }
}
