//! The same arithmetic as bare loops: one pipe, one reservoir, one valve, nothing else. What a specialist would write
//! by hand for exactly one case, to measure what the solver pays for its generality.

/// One uniform pipe and its closure.
#[derive(Clone, Copy)]
pub struct Pipe {
    /// Reaches.
    pub reaches: usize,
    /// Inner diameter, m.
    pub diameter_m: f64,
    /// Wave speed over g, s: `dH = B dV`.
    pub b_s: f64,
    /// Head lost over one reach at 1 m/s, m.
    pub r: f64,
    /// Time step, s.
    pub dt_s: f64,
    /// Closing time, s.
    pub closing_time_s: f64,
    /// Velocity before the closure, m/s.
    pub velocity_m_s: f64,
    /// Head at the valve before the closure, m.
    pub valve_head_m: f64,
}

/// Heads and velocities at the nodes, now and one step later.
struct Nodes {
    h: Vec<f64>,
    v: Vec<f64>,
    new_h: Vec<f64>,
    new_v: Vec<f64>,
}

impl Pipe {
    fn nodes(&self) -> Nodes {
        let n = self.reaches + 1;
        let loss = self.r * self.velocity_m_s * self.velocity_m_s;
        let h: Vec<f64> = (0..n).map(|i| self.valve_head_m + loss * (self.reaches - i) as f64).collect();
        let v = vec![self.velocity_m_s; n];
        Nodes { new_h: h.clone(), new_v: v.clone(), h, v }
    }

    /// Velocity through the valve for the characteristic `H + z V = e`.
    fn valve(&self, step: usize, z: f64, e: f64) -> f64 {
        let opening = 1.0 - (step as f64 * self.dt_s / self.closing_time_s).min(1.0);
        let c = (opening * self.velocity_m_s).powi(2) / self.valve_head_m;
        0.5 * e.signum() * (((z * c).powi(2) + 4.0 * c * e.abs()).sqrt() - z * c)
    }

    /// The elastic pipe with steady friction, as in the textbooks. Heads at the valve.
    pub fn elastic(&self, steps: usize) -> Vec<f64> {
        let (n, b, r) = (self.reaches + 1, self.b_s, self.r);
        let Nodes { mut h, mut v, mut new_h, mut new_v } = self.nodes();
        let mut trace = Vec::with_capacity(steps + 1);
        trace.push(h[n - 1]);
        let supply = h[0];
        for step in 1..=steps {
            let (hl, hr, vl, vr) = (&h[..n - 2], &h[2..], &v[..n - 2], &v[2..]);
            let (ho, vo) = (&mut new_h[1..n - 1], &mut new_v[1..n - 1]);
            for i in 0..n - 2 {
                let cp = hl[i] + b * vl[i] - r * vl[i] * vl[i].abs();
                let cm = hr[i] - b * vr[i] + r * vr[i] * vr[i].abs();
                ho[i] = 0.5 * (cp + cm);
                vo[i] = 0.5 / b * (cp - cm);
            }
            let cm = h[1] - b * v[1] + r * v[1] * v[1].abs();
            new_h[0] = supply;
            new_v[0] = (supply - cm) / b;
            let cp = h[n - 2] + b * v[n - 2] - r * v[n - 2] * v[n - 2].abs();
            new_v[n - 1] = self.valve(step, b, cp);
            new_h[n - 1] = cp - b * new_v[n - 1];
            std::mem::swap(&mut h, &mut new_h);
            std::mem::swap(&mut v, &mut new_v);
            trace.push(h[n - 1]);
        }
        trace
    }

    /// Two Kelvin-Voigt elements, retarded strains in the same pass. `creep` holds `F J` and `tau`.
    ///
    /// Storage is trapezoidal along the characteristic: each element takes `½ dt (ẇ_P + ẇ_A)`, `ẇ = (F J h - w)/τ`.
    pub fn two_kelvin_voigt(&self, steps: usize, creep: [(f64, f64); 2]) -> Vec<f64> {
        let (n, b, r) = (self.reaches + 1, self.b_s, self.r);
        let Nodes { mut h, mut v, mut new_h, mut new_v } = self.nodes();
        let steady = h.clone();
        // w⁺ = E w + F J (p1 h⁺ + p0 h); what is stored in a step is w⁺ - w.
        let [(e1, a1, c1), (e2, a2, c2)] = creep.map(|(fj, tau)| {
            let x = self.dt_s / tau;
            let e = (-x).exp();
            let mean = (1.0 - e) / x;
            (e, fj * (1.0 - mean), fj * (mean - e))
        });
        let by = 1.0 / (1.0 + a1 + a2);
        let (mut w1, mut w2) = (vec![0.0; n], vec![0.0; n]);
        let mut trace = Vec::with_capacity(steps + 1);
        trace.push(h[n - 1]);
        for step in 1..=steps {
            {
                let (hl, hc, hr, vl, vr) = (&h[..n - 2], &h[1..n - 1], &h[2..], &v[..n - 2], &v[2..]);
                let (ho, vo) = (&mut new_h[1..n - 1], &mut new_v[1..n - 1]);
                let (w1, w2, h0) = (&mut w1[1..n - 1], &mut w2[1..n - 1], &steady[1..n - 1]);
                for i in 0..n - 2 {
                    let cp = hl[i] + b * vl[i] - r * vl[i] * vl[i].abs();
                    let cm = hr[i] - b * vr[i] + r * vr[i] * vr[i].abs();
                    let old = hc[i] - h0[i];
                    let (k1, k2) = (e1 * w1[i] + c1 * old, e2 * w2[i] + c2 * old);
                    let new = (0.5 * (cp + cm) - h0[i] - (k1 - w1[i]) - (k2 - w2[i])) * by;
                    w1[i] = k1 + a1 * new;
                    w2[i] = k2 + a2 * new;
                    ho[i] = new + h0[i];
                    vo[i] = 0.5 / b * (cp - cm);
                }
            }
            let cm = h[1] - b * v[1] + r * v[1] * v[1].abs();
            new_h[0] = h[0];
            new_v[0] = (h[0] - cm) / b;
            let cp = h[n - 2] + b * v[n - 2] - r * v[n - 2] * v[n - 2].abs();
            let old = h[n - 1] - steady[n - 1];
            let (k1, k2) = (e1 * w1[n - 1] + c1 * old, e2 * w2[n - 1] + c2 * old);
            let e = (cp - steady[n - 1] - (k1 - w1[n - 1]) - (k2 - w2[n - 1])) * by + steady[n - 1];
            new_v[n - 1] = self.valve(step, b * by, e);
            new_h[n - 1] = e - b * by * new_v[n - 1];
            let new = new_h[n - 1] - steady[n - 1];
            w1[n - 1] = k1 + a1 * new;
            w2[n - 1] = k2 + a2 * new;
            std::mem::swap(&mut h, &mut new_h);
            std::mem::swap(&mut v, &mut new_v);
            trace.push(h[n - 1]);
        }
        trace
    }

    /// Unsteady friction by convolution with `K` exponentials. `kernel` holds the head a reach takes, m per m/s, and
    /// the decay, 1/s.
    pub fn unsteady_friction<const K: usize>(&self, steps: usize, kernel: [(f64, f64); K]) -> Vec<f64> {
        let (n, b, r) = (self.reaches + 1, self.b_s, self.r);
        let Nodes { mut h, mut v, mut new_h, mut new_v } = self.nodes();
        // y⁺ = E y + m (1-E)/x dV; the shear of a node's own reach is Σ y.
        let decay = kernel.map(|(_, rate)| (-rate * self.dt_s).exp());
        let gain = kernel.map(|(m, rate)| m * (1.0 - (-rate * self.dt_s).exp()) / (rate * self.dt_s));
        let mut y: [Vec<f64>; K] = std::array::from_fn(|_| vec![0.0; n]);
        let mut shear = vec![0.0; n];
        let mut trace = Vec::with_capacity(steps + 1);
        trace.push(h[n - 1]);
        let supply = h[0];
        for step in 1..=steps {
            let (hl, hr, vl, vr) = (&h[..n - 2], &h[2..], &v[..n - 2], &v[2..]);
            let (sl, sr) = (&shear[..n - 2], &shear[2..]);
            let (ho, vo) = (&mut new_h[1..n - 1], &mut new_v[1..n - 1]);
            for i in 0..n - 2 {
                let cp = hl[i] + b * vl[i] - r * vl[i] * vl[i].abs() - sl[i];
                let cm = hr[i] - b * vr[i] + r * vr[i] * vr[i].abs() + sr[i];
                ho[i] = 0.5 * (cp + cm);
                vo[i] = 0.5 / b * (cp - cm);
            }
            let cm = h[1] - b * v[1] + r * v[1] * v[1].abs() + shear[1];
            new_h[0] = supply;
            new_v[0] = (supply - cm) / b;
            let cp = h[n - 2] + b * v[n - 2] - r * v[n - 2] * v[n - 2].abs() - shear[n - 2];
            new_v[n - 1] = self.valve(step, b, cp);
            new_h[n - 1] = cp - b * new_v[n - 1];
            // All terms of a node in one pass.
            let lanes = y.each_mut().map(|lane| &mut lane[..n]);
            let (old, new, shear) = (&v[..n], &new_v[..n], &mut shear[..n]);
            for i in 0..n {
                let change = new[i] - old[i];
                let mut sum = 0.0;
                for k in 0..K {
                    let value = decay[k] * lanes[k][i] + gain[k] * change;
                    lanes[k][i] = value;
                    sum += value;
                }
                shear[i] = sum;
            }
            std::mem::swap(&mut h, &mut new_h);
            std::mem::swap(&mut v, &mut new_v);
            trace.push(h[n - 1]);
        }
        trace
    }
}
