//! What a forcing follows: the head or the flow at its place, their rates, or a threshold.
//!
//! Each law is a regression of the recovered forcing, weighted by its errors; the one that leaves least is taken where
//! it leaves little.

use crate::extent::ends;

/// Share of a forcing's variance that a law must explain to be said.
const LEAST_SHARE: f64 = 0.75;
/// What a simple law may explain less than a threshold, which has one number more.
const FOR_A_NUMBER: f64 = 0.02;

/// A law; `scale` is in the forcing's unit over that of what it follows.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// `scale √(H - above)` above a head, m: an orifice that opens.
    OpensAbove {
        /// The head, m.
        above_m: f64,
        /// Forcing over the root of a head.
        scale: f64,
    },
    /// `scale (H - above)` above a head, m.
    GrowsAbove {
        /// The head, m.
        above_m: f64,
        /// Forcing over a head.
        scale: f64,
    },
    /// `scale √H`, H from the atmosphere: an orifice.
    Orifice {
        /// Forcing over the root of a head.
        scale: f64,
    },
    /// `scale (H - H0)`.
    Head {
        /// Forcing over a head.
        scale: f64,
    },
    /// `scale (H - H0)²`.
    HeadSquared {
        /// Forcing over the square of a head.
        scale: f64,
    },
    /// `scale Q|Q|`.
    FlowSquared {
        /// Forcing over the square of a flow.
        scale: f64,
    },
    /// `scale ∫Q dt`: what has flown through.
    Volume {
        /// Forcing over a volume.
        scale: f64,
    },
    /// `scale dH/dt`.
    HeadRate {
        /// Forcing over a rate of head.
        scale: f64,
    },
}

/// What a forcing may follow, at its knots.
pub(crate) struct Followed<'a> {
    /// Time between knots, s.
    pub(crate) step_s: f64,
    /// Head, m, and its value before the closure.
    pub(crate) head_m: &'a [f64],
    pub(crate) before_m: f64,
    /// Elevation of the place, m.
    pub(crate) elevation_m: f64,
    /// Flow, m³/s.
    pub(crate) flow_m3_s: &'a [f64],
    /// The forcing is itself the head there: it follows that trivially.
    pub(crate) is_the_head: bool,
}

/// The law of a forcing and the share of its variance that it explains; none where none explains most of it.
pub(crate) fn law_of(value: &[f64], sd: &[f64], followed: &Followed) -> Option<(Law, f64)> {
    let h = followed.head_m;
    let last = value.len().saturating_sub(1);
    let rate = |i: usize| (h[(i + 1).min(last)] - h[i.saturating_sub(1)]) / (2.0 * followed.step_s);
    let mut volume = 0.0;
    let volumes: Vec<f64> = followed
        .flow_m3_s
        .iter()
        .map(|q| {
            volume += q * followed.step_s;
            volume
        })
        .collect();
    let of = |f: &dyn Fn(usize) -> f64| (0..value.len()).map(f).collect::<Vec<f64>>();
    let fit = |x: Vec<f64>, has_level: bool| regression(value, sd, &x, has_level);
    let steady = followed.before_m;
    let of_head: [Fitted; 4] = [
        (|scale| Law::Orifice { scale }, fit(of(&|i| (h[i] - followed.elevation_m).max(0.0).sqrt()), false)),
        (|scale| Law::Head { scale }, fit(of(&|i| h[i] - steady), true)),
        (|scale| Law::HeadSquared { scale }, fit(of(&|i| (h[i] - steady).powi(2)), true)),
        (|scale| Law::HeadRate { scale }, fit(of(&rate), true)),
    ];
    let of_flow: [Fitted; 2] = [
        (|scale| Law::FlowSquared { scale }, fit(of(&|i| followed.flow_m3_s[i] * followed.flow_m3_s[i].abs()), true)),
        (|scale| Law::Volume { scale }, fit(volumes, true)),
    ];
    let of_head = of_head.into_iter().filter(|_| !followed.is_the_head);
    let (law, (scale, share)) = of_head.chain(of_flow).max_by(|a, b| a.1.1.total_cmp(&b.1.1))?;
    let simple = (law(scale), share);
    let (low, high) = ends(h);
    let thresholds = (1..40).map(|i| low + (high - low) * f64::from(i) / 40.0).flat_map(|above_m| {
        let root = fit(of(&|i| (h[i] - above_m).max(0.0).sqrt()), false);
        let line = fit(of(&|i| (h[i] - above_m).max(0.0)), false);
        [(Law::OpensAbove { above_m, scale: root.0 }, root.1), (Law::GrowsAbove { above_m, scale: line.0 }, line.1)]
    });
    let threshold = thresholds.max_by(|a, b| a.1.total_cmp(&b.1))?;
    let is_better = !followed.is_the_head && threshold.1 > simple.1 + FOR_A_NUMBER;
    let best = if is_better { threshold } else { simple };
    (best.1 > LEAST_SHARE).then_some(best)
}

/// A law by its scale; the scale that fits, and the share of the forcing that it explains.
type Fitted = (fn(f64) -> Law, (f64, f64));

/// Slope of a forcing over `x`, with a level of its own or through zero, and the share of its weighted variance that
/// this explains.
fn regression(value: &[f64], sd: &[f64], x: &[f64], has_level: bool) -> (f64, f64) {
    let weights: Vec<f64> = sd.iter().map(|sd| 1.0 / sd.powi(2)).collect();
    let total: f64 = weights.iter().sum();
    let mean = |of: &[f64]| of.iter().zip(&weights).map(|(v, w)| v * w).sum::<f64>() / total;
    let (v_mean, x_mean) = (mean(value), if has_level { mean(x) } else { 0.0 });
    let level = if has_level { v_mean } else { 0.0 };
    let (mut xx, mut xv, mut vv) = (0.0, 0.0, 0.0);
    for ((v, x), w) in value.iter().zip(x).zip(&weights) {
        xx += w * (x - x_mean).powi(2);
        xv += w * (x - x_mean) * (v - level);
        vv += w * (v - v_mean).powi(2);
    }
    let slope = xv / xx;
    let left: f64 =
        value.iter().zip(x).zip(&weights).map(|((v, x), w)| w * (v - level - slope * (x - x_mean)).powi(2)).sum();
    if slope.is_finite() { (slope, 1.0 - left / vv) } else { (0.0, 0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(value: impl Fn(f64, f64) -> f64) -> Option<Law> {
        let time_s: Vec<f64> = (0..400).map(|i| f64::from(i) * 0.01).collect();
        let head_m: Vec<f64> = time_s.iter().map(|t| 40.0 + 25.0 * (3.0 * t).cos() * (-0.3 * t).exp()).collect();
        let flow_m3_s: Vec<f64> = time_s.iter().map(|t| 1e-3 * (3.0 * t).sin() * (-0.3 * t).exp()).collect();
        let values: Vec<f64> = head_m.iter().zip(&flow_m3_s).map(|(h, q)| value(*h, *q)).collect();
        let sd = vec![0.01 * values.iter().fold(0.0, |m: f64, v| m.max(v.abs())); values.len()];
        let followed = Followed {
            step_s: 0.01,
            head_m: &head_m,
            before_m: 40.0,
            elevation_m: 0.0,
            flow_m3_s: &flow_m3_s,
            is_the_head: false,
        };
        law_of(&values, &sd, &followed).map(|(law, _)| law)
    }

    #[test]
    fn laws_are_told_by_what_a_forcing_follows() {
        let opens = found(|h, _| 2e-4 * (h - 52.0).max(0.0).sqrt());
        assert!(matches!(opens, Some(Law::OpensAbove { above_m, .. }) if (above_m - 52.0).abs() < 1.5), "{opens:?}");
        let saturates = found(|h, _| -0.3 * (h - 50.0).max(0.0));
        let near = |scale: f64| (scale + 0.3).abs() < 0.03;
        assert!(matches!(saturates, Some(Law::GrowsAbove { scale, .. }) if near(scale)), "{saturates:?}");
        let orifice = found(|h, _| 1e-5 * h.sqrt());
        assert!(matches!(orifice, Some(Law::Orifice { scale }) if (scale / 1e-5 - 1.0).abs() < 1e-3), "{orifice:?}");
        let loss = found(|_, q| -3e6 * q * q.abs());
        assert!(matches!(loss, Some(Law::FlowSquared { scale }) if (scale / -3e6 - 1.0).abs() < 1e-2), "{loss:?}");
        let mut random = fastrand::Rng::with_seed(1);
        let noise: Vec<f64> = (0..400).map(|_| random.f64() - 0.5).collect();
        let next = std::cell::Cell::new(0);
        let none = found(|_, _| noise[next.replace(next.get() + 1)]);
        assert_eq!(none, None);
    }
}
