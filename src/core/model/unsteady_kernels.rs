//! Memory of the wall shear: weighting functions of unsteady friction as sums of exponentials, and the steps of their
//! convolution with the flow.
//!
//! Time is in units of the diffusion time, `θ = 4νt/D²`. Laminar (Zielke 1968, J. Basic Eng. 90:109-115):
//! `W = Σ exp(-j²θ)` over the zeros `j` of the Bessel function J₂. Turbulent (Vardy & Brown 2003, J. Sound Vib.
//! 259:1011-1036, smooth pipes): `W = A* exp(-B*θ)/√θ`, `A* = 1/(2√π)`, `B* = Re^κ/12.86`,
//! `κ = log10(15.29/Re^0.0567)`. Both start as `1/(2√(πθ))`.

use crate::rig::Regime;

/// Terms `(n, m)` of `W ≈ Σ m exp(-nθ)` for Zielke's function (Kagawa et al. 1983, Trans. JSME 49:2638-2644):
/// within 0.3% at θ = 0.04, 0.1% elsewhere from 1e-5 on.
const ZIELKE: [(f64, f64); 10] = [
    (26.3744, 1.0),
    (72.8033, 1.16725),
    (187.424, 2.20064),
    (536.626, 3.92861),
    (1570.60, 6.78788),
    (4618.13, 11.6761),
    (13601.1, 20.0612),
    (40082.5, 34.4541),
    (118153.0, 59.1642),
    (348316.0, 101.590),
];

/// Ratio of `n` between the last terms of [`ZIELKE`], by which it is continued.
const ZIELKE_RATIO: f64 = 2.948;

/// Terms of `1/√θ ≈ Σ m exp(-nθ)` (Vítkovský et al. 2004, Proc. 9th Int. Conf. Pressure Surges) without the last two of
/// ten, which were adjusted to end the sum. [`Kernel::steps`] continues it.
const INVERSE_ROOT: [(f64, f64); 8] = [
    (4.78793, 5.03362),
    (51.0897, 6.48760),
    (210.868, 10.7735),
    (765.030, 19.9040),
    (2731.01, 37.4754),
    (9731.44, 70.7117),
    (34668.5, 133.460),
    (123511.0, 251.933),
];

/// Ratio of `n` between the last terms of [`INVERSE_ROOT`], by which it is continued.
const INVERSE_ROOT_RATIO: f64 = 3.5625;

/// A term with `n` times the step beyond this is forgotten within one step: `exp(-20) = 2e-9`.
const FORGOTTEN: f64 = 20.0;

/// A weighting function.
#[derive(Debug, Clone, Copy)]
pub struct Kernel {
    terms: &'static [(f64, f64)],
    ratio: f64,
    /// `B*`: added to every `n`.
    faster: f64,
    /// `A*`: multiplies every `m`.
    amplitude: f64,
}

/// One exponential over one step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Remembered {
    /// Its remaining part after the step, `exp(-r)`, `r = n Δθ`.
    pub decay: f64,
    /// Its mean over the step, `m (1 - exp(-r))/r`.
    pub mean: f64,
}

/// A weighting function over one step.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Steps {
    /// The exponentials that outlast one step.
    pub remembered: Vec<Remembered>,
    /// Sum of the means of all others.
    pub forgotten: f64,
}

/// Mean of `exp(-x)` for `x` from 0 to `r`: `(1 - exp(-r))/r`, by its series if the difference would lose digits.
pub(crate) fn mean_of_decay(r: f64) -> f64 {
    if r < 1e-5 { 1.0 - 0.5 * r } else { -(-r).exp_m1() / r }
}

impl Steps {
    /// A sum of exponentials `m exp(-nθ)`, each given as `(n, m)`, the slowest first, over steps `Δθ`.
    pub fn of(terms: impl IntoIterator<Item = (f64, f64)>, step: f64) -> Steps {
        let mut steps = Steps::default();
        terms.into_iter().for_each(|term| steps.add(term, step));
        steps
    }

    fn add(&mut self, (n, m): (f64, f64), step: f64) {
        let r = n * step;
        let mean = m * mean_of_decay(r);
        // The slowest term always stays, whatever the step.
        if r < FORGOTTEN || self.remembered.is_empty() {
            self.remembered.push(Remembered { decay: (-r).exp(), mean });
        } else {
            self.forgotten += mean;
        }
    }

    /// Mean of the weighting function over the first step.
    pub fn first_mean(&self) -> f64 {
        self.forgotten + self.remembered.iter().map(|term| term.mean).sum::<f64>()
    }
}

impl Kernel {
    /// The weighting function of a flow.
    pub fn of(reynolds: f64, regime: Regime) -> Kernel {
        if regime == Regime::Laminar {
            return Kernel { terms: &ZIELKE, ratio: ZIELKE_RATIO, faster: 0.0, amplitude: 1.0 };
        }
        let kappa = (15.29 / reynolds.powf(0.0567)).log10();
        Kernel {
            terms: &INVERSE_ROOT,
            ratio: INVERSE_ROOT_RATIO,
            faster: reynolds.powf(kappa) / 12.86,
            amplitude: 0.5 / std::f64::consts::PI.sqrt(),
        }
    }

    /// The weighting function over steps `Δθ`.
    ///
    /// Ten terms miss what happens below θ = 1e-6, and steps of long thin pipes are shorter: the front would come out
    /// too high on any grid. As `W ~ 1/√θ` there, terms continue with `n` times the ratio and `m` times its root, as
    /// far as a step distinguishes them from zero. The means of all further terms, a geometric series, are summed in
    /// closed form.
    pub fn steps(&self, step: f64) -> Steps {
        let mut steps = Steps::default();
        let mut add = |(n, m): (f64, f64)| steps.add((n + self.faster, self.amplitude * m), step);
        self.terms.iter().copied().for_each(&mut add);
        let root = self.ratio.sqrt();
        let (mut n, mut m) = self.terms[self.terms.len() - 1];
        // Far enough that the decay of the shear no longer matters in the rest. A step of zero would continue for ever;
        // 1e30 is beyond any rig.
        while (n * step < FORGOTTEN || n < 1e4 * self.faster) && n < 1e30 {
            (n, m) = (n * self.ratio, m * root);
            add((n, m));
        }
        // Σ m/(nΔθ) over the terms that follow: each is 1/√ratio of the one before it.
        steps.forgotten += self.amplitude * m / ((n + self.faster) * step) / (root - 1.0);
        steps
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// Zeros of J₂: five from tables (Abramowitz & Stegun 9.5), the others by McMahon's expansion (ibid. 9.5.12).
    fn zero_of_j2(i: usize) -> f64 {
        const FIRST: [f64; 5] = [5.135_622_302, 8.417_244_140, 11.619_841_173, 14.795_951_782, 17.959_819_495];
        FIRST.get(i - 1).copied().unwrap_or_else(|| {
            let (beta, mu) = ((i as f64 + 0.75) * PI, 16.0);
            let e = 8.0 * beta;
            beta - (mu - 1.0) / e - 4.0 * (mu - 1.0) * (7.0 * mu - 31.0) / (3.0 * e.powi(3))
        })
    }

    /// Zielke's function: his series of half powers early, the sum over Bessel zeros late.
    fn zielke(theta: f64) -> f64 {
        if theta > 0.005 {
            return (1..200).map(|i| (-zero_of_j2(i).powi(2) * theta).exp()).sum();
        }
        let x = theta.sqrt();
        0.5 / (PI * theta).sqrt() - 1.25 + x * (1.057855 + x * (0.937500 + x * (0.396696 - 0.351563 * x)))
    }

    /// Its integral from 0.
    fn zielke_integral(theta: f64) -> f64 {
        let x = theta.sqrt();
        let half_powers = 1.057855 / 1.5 * x.powi(3) + 0.9375 / 2.0 * x.powi(4) + 0.396696 / 2.5 * x.powi(5);
        x / PI.sqrt() - 1.25 * theta + half_powers - 0.351563 / 3.0 * x.powi(6)
    }

    #[test]
    fn zielkes_two_forms_agree_where_they_meet() {
        for theta in [0.0005, 0.002, 0.0049] {
            let zeros: f64 = (1..400).map(|i| (-zero_of_j2(i).powi(2) * theta).exp()).sum();
            assert!((zeros / zielke(theta) - 1.0).abs() < 2e-6, "{theta}: {zeros} {}", zielke(theta));
        }
    }

    /// `W` between steps as the sum has it: means over whole steps give the value at the later time that the
    /// exponentials start from.
    fn value(steps: &Steps, whole_steps: i32) -> f64 {
        steps.remembered.iter().map(|term| term.mean * term.decay.powi(whole_steps)).sum()
    }

    /// Means of the exact function over the step that begins after so many whole steps, by Gauss's three points.
    fn exact_mean(w: impl Fn(f64) -> f64, step: f64, whole_steps: i32) -> f64 {
        let from = f64::from(whole_steps) * step;
        let at = |x: f64| w(from + 0.5 * step * (1.0 + x));
        let x = 0.6f64.sqrt();
        (5.0 * at(-x) + 8.0 * at(0.0) + 5.0 * at(x)) / 18.0
    }

    /// Steps from 1e-11 to 1e-2 and durations up to θ = 2.
    #[test]
    fn the_laminar_sum_is_zielkes_function_at_every_step_and_duration() {
        let kernel = Kernel::of(1000.0, Regime::Laminar);
        for exponent in -110..=-20 {
            let step = 10f64.powf(0.1 * f64::from(exponent));
            let steps = kernel.steps(step);
            let first = steps.first_mean() * step / zielke_integral(step) - 1.0;
            assert!(first.abs() < 2e-3, "step {step:e}: first mean off by {first:e}");
            let mut later = 4.0;
            while later * step < 2.0 && later < 1e9 {
                let whole = later as i32;
                let off = value(&steps, whole) / exact_mean(zielke, step, whole) - 1.0;
                assert!(off.abs() < 3.1e-3, "step {step:e}, after {whole}: {off:e}");
                later *= 1.3;
            }
        }
    }

    #[test]
    fn the_turbulent_sum_is_vardy_and_browns_function_at_every_step_and_duration() {
        for reynolds in [2320.0, 1e4, 1e5, 1e6, 1e7] {
            let kernel = Kernel::of(reynolds, Regime::Turbulent);
            let shear = reynolds.powf((15.29 / reynolds.powf(0.0567)).log10()) / 12.86;
            let exact = |theta: f64| (-shear * theta).exp() / (2.0 * (PI * theta).sqrt());
            for exponent in -110..=-20 {
                let step = 10f64.powf(0.1 * f64::from(exponent));
                let steps = kernel.steps(step);
                let mut later = 4.0;
                // As long as anything is left of it: exp(-15).
                while later * step * shear < 15.0 && later < 1e9 {
                    let whole = later as i32;
                    // Where a step is long for the function, three points do not integrate it.
                    if step * shear > 1.0 {
                        break;
                    }
                    let off = value(&steps, whole) / exact_mean(exact, step, whole) - 1.0;
                    assert!(off.abs() < 3e-3, "Re {reynolds}, step {step:e}, after {whole}: {off:e}");
                    later *= 1.3;
                }
                // ∫ W over the first step: ½ √(1/B*) erf(√(B* Δθ)), erf by its series.
                let x = (shear * step).sqrt();
                if x < 1.5 {
                    let (mut term, mut erf) = (x, x);
                    for k in 1..40 {
                        term *= -x * x / f64::from(k);
                        erf += term / f64::from(2 * k + 1);
                    }
                    let integral = erf / (PI.sqrt() * shear.sqrt());
                    let first = steps.first_mean() * step / integral - 1.0;
                    assert!(first.abs() < 2e-3, "Re {reynolds}, step {step:e}: first mean off by {first:e}");
                }
            }
        }
    }

    /// What a step forgets is kept in the mean: the split between remembered and forgotten terms moves nothing.
    #[test]
    fn few_terms_at_long_steps_and_more_at_short_ones() {
        let kernel = Kernel::of(500.0, Regime::Laminar);
        let counts = [1e-1, 1e-3, 1e-6, 1e-8, 1e-11].map(|step| kernel.steps(step).remembered.len());
        assert_eq!(counts[0], 3, "{counts:?}");
        assert!(counts.windows(2).all(|w| w[0] < w[1]) && counts[4] < 30, "{counts:?}");
        assert!(kernel.steps(0.0).remembered.len() < 100);
    }
}
