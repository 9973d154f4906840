//! Nodes with elements: joints of pipes, leaks, blockages, branches, gas, and the valve's end.
//!
//! Each side sends one characteristic, linear in head and flow. An element is either a *shunt*, which takes out of the
//! node a flow that does not fall with the head, or a *loss*, across which the head drops by `K Q|Q|`. Any number of
//! both at one node leave one scalar equation in the head behind the losses; it is increasing, and a safeguarded Newton
//! iteration solves it.
//!
//! A shunt between nodes is one element all the same ([`Spread`]): it sees the head that is interpolated between them,
//! and takes its flow from them by the same weights, so that it neither adds nor loses energy. A loss between nodes is
//! shared among them ([`Overlap`]). Either meets what it sent out itself at the other nodes one to three steps before.
//! These waves amount to an inertance (for losses a capacitance) that a single element does not have, an error of first
//! order. It is removed.

/// An element that takes water out of a node: a leak, a branch, a gas volume, a moving wall. Heads are total heads, m.
pub trait Shunt: Send {
    /// Learns the flow that goes on behind it, m³/s, before [`Shunt::settle`] and with each step's solution.
    fn passing(&mut self, flow_m3_s: f64) {
        let _ = flow_m3_s;
    }
    /// Outflow before the closure, m³/s; initialises the inner state.
    fn settle(&mut self, head_m: f64) -> f64;
    /// Outflow at the new time if the head is `head_m`, m³/s, and its derivative by the head (zero or more).
    fn outflow(&self, head_m: f64) -> (f64, f64);
    /// Advances the inner state with the new head.
    fn advance(&mut self, head_m: f64);
}

/// A head loss of any law of the flow, or a share of one, m.
pub trait HeadLoss: Send {
    /// Learns the head behind it, m, before [`HeadLoss::settle`] and with each step's solution.
    fn facing(&mut self, head_m: f64) {
        let _ = head_m;
    }
    /// Loss before the closure; initialises the inner state.
    fn settle(&mut self, flow_m3_s: f64) -> f64;
    /// Loss at the new time, and its derivative by the flow (zero or more).
    fn drop_m(&self, flow_m3_s: f64) -> (f64, f64);
    /// The same before the closure.
    fn steady_drop_m(&self, flow_m3_s: f64) -> (f64, f64);
    /// Advances the inner state with the new flow.
    fn advance(&mut self, flow_m3_s: f64);
}

/// Overlap of the shares of one element at neighbouring nodes: `Σ w_i w_j` over neighbours, and over nodes two reaches
/// apart, divided by the share's own weight.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Overlap([f64; 2]);

impl Overlap {
    /// Overlap of the share `own` among `shares`, nodes and weights.
    pub fn of(shares: &[(usize, f64)], own: f64) -> Overlap {
        let apart = |distance: usize| {
            let pairs = shares.iter().flat_map(|a| shares.iter().map(move |b| (a, b)));
            pairs.filter(|(a, b)| b.0 == a.0 + distance).map(|(a, b)| a.1 * b.1).sum::<f64>() / own
        };
        Overlap([apart(1), apart(2)])
    }

    fn times(self, by: f64) -> [f64; 2] {
        self.0.map(|c| c * by)
    }
}

/// A shunt between nodes. At the head `h` that the nodes would have without it, interpolated, it sees
/// `h - z q - Z Σ c_n (q - q_n)`: `z` is what its own flow takes at once, `q_n` the flow `n` steps before, and
/// `c_n = Σ w_i w_j` over nodes `n` reaches apart.
pub struct Spread {
    shunt: Box<dyn Shunt>,
    /// The effect that it belongs to.
    pub owner: usize,
    /// Joints and weights.
    pub at: Vec<(usize, f64)>,
    by: [f64; 3],
    flows_m3_s: [f64; 3],
    /// Outflow at the new time, m³/s.
    pub flow_m3_s: f64,
    head_m: f64,
}

impl Spread {
    /// Over joints on a line of impedance `z`.
    pub fn new(shunt: Box<dyn Shunt>, owner: usize, at: Vec<(usize, f64)>, z: f64) -> Spread {
        let by = [1, 2, 3].map(|distance| {
            let apart =
                |&(i, w): &(usize, f64)| at.iter().find(|(j, _)| *j == i + distance).map_or(0.0, |(_, v)| w * v);
            z * at.iter().map(apart).sum::<f64>()
        });
        Spread { shunt, owner, at, by, flows_m3_s: [0.0; 3], flow_m3_s: 0.0, head_m: 0.0 }
    }

    /// Outflow before the closure at an interpolated head where a flow goes on, m³/s; initialises the inner state.
    pub fn settle(&mut self, head_m: f64, passing_m3_s: f64) -> f64 {
        self.head_m = head_m;
        self.shunt.passing(passing_m3_s);
        self.flow_m3_s = self.shunt.settle(head_m);
        self.flows_m3_s = [self.flow_m3_s; 3];
        self.flow_m3_s
    }

    /// Finds the outflow at the new time from the interpolated head without it, and what one m³/s of it takes of that
    /// at once.
    #[inline]
    pub fn find(&mut self, free_head_m: f64, z: f64) {
        let ([by_1, by_2, by_3], [q_1, q_2, q_3]) = (self.by, self.flows_m3_s);
        let by = z + (by_1 + by_2 + by_3);
        let known = free_head_m + (by_1 * q_1 + by_2 * q_2 + by_3 * q_3);
        let (head_m, (flow_m3_s, _)) = root(
            |x| {
                let (q, dq) = self.shunt.outflow(x);
                (x + by * q - known, 1.0 + by * dq, (q, dq))
            },
            |(q, dq), step| (q + dq * step, dq),
            self.head_m,
        );
        (self.head_m, self.flow_m3_s) = (head_m, flow_m3_s);
    }

    /// Advances the inner state with the latest solution, where a flow goes on.
    #[inline]
    pub fn advance(&mut self, passing_m3_s: f64) {
        self.shunt.advance(self.head_m);
        self.shunt.passing(passing_m3_s);
        self.flows_m3_s = [self.flow_m3_s, self.flows_m3_s[0], self.flows_m3_s[1]];
    }
}

/// A share of a head loss `k u|u|`: what passes it, `u`, is the flow less `Σ c_n (d - d_n)/Z`, `d` the drop, `d_n` the
/// one `n` steps before.
#[derive(Debug, Clone, PartialEq)]
pub struct Loss {
    k: f64,
    by: [f64; 2],
    drops_m: [f64; 2],
}

impl Loss {
    /// A share with `k = K/(2gA²)`, s²/m⁵, on a line of impedance `z`.
    pub fn new(k: f64, overlap: Overlap, z: f64) -> Loss {
        Loss { k, by: overlap.times(1.0 / z), drops_m: [0.0; 2] }
    }

    fn settle(&mut self, flow_m3_s: f64) -> f64 {
        self.drops_m = [self.k * flow_m3_s * flow_m3_s.abs(); 2];
        self.drops_m[0]
    }

    /// Head drop at a flow, and its derivative.
    #[inline]
    fn drop_m(&self, flow_m3_s: f64) -> (f64, f64) {
        let by = self.by[0] + self.by[1];
        let known = flow_m3_s + self.by[0] * self.drops_m[0] + self.by[1] * self.drops_m[1];
        // u + by k u|u| = known
        let u = 2.0 * known / (1.0 + (1.0 + 4.0 * by * self.k * known.abs()).sqrt());
        let slope = 2.0 * self.k * u.abs();
        (self.k * u * u.abs(), slope / (1.0 + by * slope))
    }

    /// Alone between two pipes, behind which `taken_m3_s` leaves: with `u` for what passes, one quadratic.
    #[inline]
    fn between(&self, left: Arriving, right: Arriving, taken_m3_s: f64) -> Solved {
        let (by, z) = (self.by[0] + self.by[1], left.z + right.z);
        let before = self.by[0] * self.drops_m[0] + self.by[1] * self.drops_m[1];
        // z u + (1 + z by) k u|u| = known
        let known = left.e - right.e + right.z * taken_m3_s + z * before;
        let u = 2.0 * known / (z + (z * z + 4.0 * (1.0 + z * by) * self.k * known.abs()).sqrt());
        let drop_m = self.k * u * u.abs();
        let left_flow_m3_s = u + by * drop_m - before;
        let right_flow_m3_s = left_flow_m3_s - taken_m3_s;
        let right_head_m = right.e + right.z * right_flow_m3_s;
        Solved { left_head_m: right_head_m + drop_m, left_flow_m3_s, right_head_m, right_flow_m3_s }
    }

    fn advance(&mut self, flow_m3_s: f64) {
        self.drops_m = [self.drop_m(flow_m3_s).0, self.drops_m[0]];
    }
}

/// The characteristic that reaches a node along a pipe, in total heads: `H + z Q = e` from upstream, `H - z Q = e` from
/// downstream.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arriving {
    /// Effective impedance, s/m².
    pub z: f64,
    /// Known part, m.
    pub e: f64,
}

impl Arriving {
    /// Where no pipe is.
    pub const NOTHING: Arriving = Arriving { z: f64::INFINITY, e: 0.0 };

    /// Whether a pipe is there.
    #[inline(always)]
    pub fn is_something(self) -> bool {
        self.z < f64::INFINITY
    }

    /// Two that arrive at one head, as one.
    #[inline(always)]
    pub fn and(self, other: Arriving) -> Arriving {
        match (self.is_something(), other.is_something()) {
            (true, true) => {
                let by_both = 1.0 / (self.z + other.z);
                Arriving { z: self.z * other.z * by_both, e: (self.e * other.z + other.e * self.z) * by_both }
            }
            (true, false) => self,
            _ => other,
        }
    }

    /// What it brings into a node of this head, m³/s.
    #[inline(always)]
    pub fn inflow_m3_s(self, head_m: f64) -> f64 {
        (self.e - head_m) / self.z
    }
}

/// Head and flow on both sides of a node.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solved {
    /// Head upstream of the losses, m.
    pub left_head_m: f64,
    /// Flow that arrives, m³/s.
    pub left_flow_m3_s: f64,
    /// Head downstream of the losses, m.
    pub right_head_m: f64,
    /// Flow that goes on, m³/s.
    pub right_flow_m3_s: f64,
}

/// A share of a head loss of any law. It meets what it sends to its other shares as [`Loss`] does.
pub struct Lossy {
    law: Box<dyn HeadLoss>,
    /// Impedance of the line, s/m².
    z: f64,
    by: [f64; 2],
    drops_m: [f64; 2],
}

impl Lossy {
    /// A share on a line of impedance `z`.
    pub fn new(law: Box<dyn HeadLoss>, overlap: Overlap, z: f64) -> Lossy {
        Lossy { law, z, by: overlap.times(1.0 / z), drops_m: [0.0; 2] }
    }

    fn settle(&mut self, flow_m3_s: f64) -> f64 {
        self.drops_m = [self.law.settle(flow_m3_s); 2];
        self.drops_m[0]
    }

    /// The flow that the share sees, if the node's is `flow_m3_s`; with it head drop and derivative by the node's flow.
    fn seen(&self, flow_m3_s: f64) -> (f64, (f64, f64)) {
        let by = self.by[0] + self.by[1];
        let known = flow_m3_s + self.by[0] * self.drops_m[0] + self.by[1] * self.drops_m[1];
        if by == 0.0 {
            return (known, self.law.drop_m(known));
        }
        // As a head `z u`, for which the root's tolerances are made.
        let balance = |x: f64| {
            let drop = self.law.drop_m(x / self.z);
            (x + self.z * (by * drop.0 - known), 1.0 + by * drop.1, drop)
        };
        let beyond = |(drop, slope): (f64, f64), step: f64| (drop + slope * step / self.z, slope);
        let (x, (drop_m, slope)) = root(balance, beyond, self.z * flow_m3_s);
        (x / self.z, (drop_m, slope / (1.0 + by * slope)))
    }

    fn drop_m(&self, flow_m3_s: f64) -> (f64, f64) {
        self.seen(flow_m3_s).1
    }

    fn advance(&mut self, flow_m3_s: f64) {
        let (u, (drop_m, _)) = self.seen(flow_m3_s);
        self.law.advance(u);
        self.drops_m = [drop_m, self.drops_m[0]];
    }
}

/// The elements of one node.
#[derive(Default)]
pub struct Node {
    /// Head losses.
    pub losses: Vec<Loss>,
    /// Head losses of other laws.
    pub laws: Vec<Lossy>,
    /// Shunts, behind the losses.
    pub shunts: Vec<Box<dyn Shunt>>,
    /// What elements take here that are spread over several nodes, or what is drawn off, behind the losses, m³/s.
    pub taken_m3_s: f64,
}

impl Node {
    /// Steady state: returns head and flow before the node from those behind it.
    pub fn settle(&mut self, head_m: f64, flow_m3_s: f64) -> (f64, f64) {
        self.shunts.iter_mut().for_each(|s| s.passing(flow_m3_s));
        self.laws.iter_mut().for_each(|l| l.law.facing(head_m));
        let flow = flow_m3_s + self.taken_m3_s + self.shunts.iter_mut().map(|s| s.settle(head_m)).sum::<f64>();
        let drops = self.losses.iter_mut().map(|l| l.settle(flow)).chain(self.laws.iter_mut().map(|l| l.settle(flow)));
        (head_m + drops.sum::<f64>(), flow)
    }

    /// Whether it is a plain joint without elements of its own.
    #[inline]
    pub fn is_plain(&self) -> bool {
        self.losses.is_empty() && self.shunts.is_empty() && self.laws.is_empty()
    }

    /// Head that the losses take of a steady flow, and its derivative.
    pub fn steady_drop_m(&self, flow_m3_s: f64) -> (f64, f64) {
        let k: f64 = self.losses.iter().map(|l| l.k).sum();
        let of_losses = (k * flow_m3_s * flow_m3_s.abs(), 2.0 * k * flow_m3_s.abs());
        self.laws.iter().map(|l| l.law.steady_drop_m(flow_m3_s)).fold(of_losses, |sum, d| (sum.0 + d.0, sum.1 + d.1))
    }

    /// Head that the losses take at a flow, and its derivative.
    fn drop_m(&self, flow_m3_s: f64) -> (f64, f64) {
        let drops =
            self.losses.iter().map(|l| l.drop_m(flow_m3_s)).chain(self.laws.iter().map(|l| l.drop_m(flow_m3_s)));
        drops.fold((0.0, 0.0), |sum, d| (sum.0 + d.0, sum.1 + d.1))
    }

    /// Solves the node and advances its elements. `onward` is the flow that goes on at a head behind the losses, and
    /// its derivative; `guess_m` is a head near the solution.
    pub fn solve(&mut self, left: Arriving, onward: impl Fn(f64) -> (f64, f64), guess_m: f64) -> Solved {
        let solved = self.find(left, onward, guess_m);
        self.advance(&solved);
        solved
    }

    /// The solution alone, as [`Node::solve`]. The elements keep the state of the previous step until
    /// [`Node::advance`].
    pub fn find(&self, left: Arriving, onward: impl Fn(f64) -> (f64, f64), guess_m: f64) -> Solved {
        // F(H) = H + K Ql|Ql| + z Ql - e with Ql = onward(H) + Σ outflow(H): increasing in H.
        let balance = |head: f64| {
            let right = onward(head);
            let (mut flow, mut slope) = (right.0 + self.taken_m3_s, right.1);
            for shunt in &self.shunts {
                let (q, dq) = shunt.outflow(head);
                flow += q;
                slope += dq;
            }
            let (drop, by_flow) = self.drop_m(flow);
            (head + drop + left.z * flow - left.e, 1.0 + (by_flow + left.z) * slope, (right, (flow, slope)))
        };
        let beyond = |(right, left): ((f64, f64), (f64, f64)), step: f64| {
            ((right.0 + right.1 * step, right.1), (left.0 + left.1 * step, left.1))
        };
        let (head, ((right_flow, _), (left_flow, _))) = root(balance, beyond, guess_m);
        let drop = self.drop_m(left_flow).0;
        Solved { left_head_m: head + drop, left_flow_m3_s: left_flow, right_head_m: head, right_flow_m3_s: right_flow }
    }

    /// The solution where losses alone stand before a given head, as [`Node::find`].
    pub fn find_before(&self, left: Arriving, held_m: f64, guess_m3_s: f64) -> Solved {
        // As a head `z Q`, for which the root's tolerances are made.
        let balance = |x: f64| {
            let drop = self.drop_m(x / left.z);
            (x + drop.0 + held_m - left.e, 1.0 + drop.1 / left.z, drop)
        };
        let beyond = |drop: (f64, f64), step: f64| (drop.0 + drop.1 * step / left.z, drop.1);
        let (x, (drop_m, _)) = root(balance, beyond, left.z * guess_m3_s);
        let flow = x / left.z;
        Solved {
            left_head_m: held_m + drop_m,
            left_flow_m3_s: flow,
            right_head_m: held_m,
            right_flow_m3_s: flow - self.taken_m3_s,
        }
    }

    /// The solution between two pipes, as [`Node::find`].
    #[inline]
    pub fn find_between(&self, left: Arriving, right: Arriving, guess_m: f64) -> Solved {
        match &self.losses[..] {
            [loss] if self.shunts.is_empty() && self.laws.is_empty() => loss.between(left, right, self.taken_m3_s),
            _ => {
                let by_z = 1.0 / right.z;
                self.find(left, |h| ((h - right.e) * by_z, by_z), guess_m)
            }
        }
    }

    /// Advances the elements with a solution.
    #[inline]
    pub fn advance(&mut self, solved: &Solved) {
        for shunt in &mut self.shunts {
            shunt.advance(solved.right_head_m);
            shunt.passing(solved.right_flow_m3_s);
        }
        for loss in &mut self.losses {
            loss.advance(solved.left_flow_m3_s);
        }
        for law in &mut self.laws {
            law.advance(solved.left_flow_m3_s);
            law.law.facing(solved.right_head_m);
        }
    }
}

/// Root of a function that rises by one or more per unit, by Newton's method kept inside a bracket, with what the
/// function found there. It gives its value, its slope and its findings; `beyond` are the findings a tiny step further.
pub fn root<T>(f: impl Fn(f64) -> (f64, f64, T), beyond: impl Fn(T, f64) -> T, guess: f64) -> (f64, T) {
    const MOST: usize = 100;
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut x = guess;
    let mut width = 1.0;
    let mut calls = 1;
    loop {
        let (value, slope, found) = f(x);
        if value == 0.0 || calls == MOST || !value.is_finite() && x == guess {
            return (x, found);
        }
        if value > 0.0 {
            high = x;
        } else {
            low = x;
        }
        let newton = x - value / slope;
        // So near that the step after the next, of the order of this one's square, would be lost in rounding.
        let near = value.abs() <= 1e-7 * (1.0 + x.abs());
        // At the root itself, rounding may put Newton's step on the bracket's edge or beyond.
        let arrived = (newton - x).abs() <= 1e-13 * (1.0 + x.abs());
        let inside = newton > low && newton < high && newton.is_finite();
        if arrived || (near && inside) {
            return (newton, beyond(found, newton - x));
        }
        x = if inside {
            newton
        } else if low.is_finite() && high.is_finite() {
            0.5 * (low + high)
        } else {
            // No bracket yet: go further and further towards the root.
            width *= 2.0;
            if value > 0.0 { x - width } else { x + width }
        };
        calls += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Orifice(f64);
    impl Shunt for Orifice {
        fn settle(&mut self, head_m: f64) -> f64 {
            self.outflow(head_m).0
        }
        fn outflow(&self, head_m: f64) -> (f64, f64) {
            if head_m <= 0.0 { (0.0, 0.0) } else { (self.0 * head_m.sqrt(), 0.5 * self.0 / head_m.sqrt()) }
        }
        fn advance(&mut self, _head_m: f64) {}
    }

    #[test]
    fn a_leak_and_a_loss_at_one_node_meet_all_their_equations() {
        let mut node = Node {
            losses: vec![Loss::new(2e5, Overlap::default(), 4e4)],
            shunts: vec![Box::new(Orifice(1e-4)), Box::new(Orifice(3e-5))],
            ..Node::default()
        };
        let (left, right) = (Arriving { z: 4e4, e: 70.0 }, Arriving { z: 5e4, e: -20.0 });
        let s = node.solve(left, |h| ((h - right.e) / right.z, 1.0 / right.z), 20.0);
        assert!((s.left_head_m + left.z * s.left_flow_m3_s - left.e).abs() < 1e-9);
        assert!((s.right_head_m - right.z * s.right_flow_m3_s - right.e).abs() < 1e-9);
        let leak = 1.3e-4 * s.right_head_m.sqrt();
        assert!((s.left_flow_m3_s - s.right_flow_m3_s - leak).abs() < 1e-12);
        let loss = 2e5 * s.left_flow_m3_s * s.left_flow_m3_s.abs();
        assert!((s.left_head_m - s.right_head_m - loss).abs() < 1e-9);
    }

    #[test]
    fn a_loss_alone_has_the_closed_form() {
        let mut loss = Loss::new(2e7, Overlap([0.1, 0.02]), 4e4);
        loss.settle(1e-3);
        for (e, taken_m3_s) in [(70.0, 0.0), (-50.0, 1e-4), (20.0, -3e-5)] {
            let node = Node { losses: vec![loss.clone()], taken_m3_s, ..Node::default() };
            let (left, right) = (Arriving { z: 4e4, e }, Arriving { z: 5e4, e: 20.0 });
            let closed = node.find_between(left, right, 0.0);
            let root = node.find(left, |h| ((h - right.e) / right.z, 1.0 / right.z), 0.0);
            assert!((closed.left_head_m - root.left_head_m).abs() < 1e-9, "{closed:?} {root:?}");
            assert!((closed.right_head_m - root.right_head_m).abs() < 1e-9, "{closed:?} {root:?}");
            assert!((closed.left_flow_m3_s - root.left_flow_m3_s).abs() < 1e-13, "{closed:?} {root:?}");
            assert!((closed.right_flow_m3_s - root.right_flow_m3_s).abs() < 1e-13, "{closed:?} {root:?}");
        }
    }

    #[test]
    fn the_root_is_found_from_afar_and_across_a_kink() {
        let f = |x: f64| if x > 3.0 { (1e6 * (x - 3.0) + 1.0, 1e6, ()) } else { ((x - 2.0) * 1.0, 1.0, ()) };
        let still = |(), _| ();
        assert!((root(f, still, -500.0).0 - 2.0).abs() < 1e-9);
        assert!((root(f, still, 1e4).0 - 2.0).abs() < 1e-9);
        assert!(root(|x| (x.powi(3) + x, 3.0 * x * x + 1.0, ()), still, 5.0).0.abs() < 1e-12);
    }
}
