//! Steady wall friction: the Darcy factor of a full round pipe.

/// Reynolds number up to which the flow is taken as laminar.
pub const LAMINAR_REYNOLDS: f64 = 2320.0;
/// Reynolds number below which turbulence dies out whatever disturbs the flow (Reynolds 1883: between 1900 and 2000).
pub const CERTAINLY_LAMINAR_REYNOLDS: f64 = 2000.0;

const LEAST_TURBULENT_REYNOLDS: f64 = 1000.0;

/// Whether a flow is laminar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Regime {
    /// Layers slide along each other.
    Laminar,
    /// Eddies mix them.
    Turbulent,
}

impl Regime {
    /// Of a flow at a Reynolds number.
    pub fn of(reynolds: f64) -> Regime {
        if reynolds.abs() < LAMINAR_REYNOLDS { Regime::Laminar } else { Regime::Turbulent }
    }

    /// Of a measured flow that valves and bends disturb: laminar only where nothing else is possible.
    pub fn of_disturbed(reynolds: f64) -> Regime {
        if reynolds.abs() < CERTAINLY_LAMINAR_REYNOLDS { Regime::Laminar } else { Regime::Turbulent }
    }
}

/// Darcy friction factor f of the head loss `f L/D V²/2g`.
///
/// Laminar up to Re 2320: f = 64/Re (Hagen–Poiseuille). Above: Colebrook & White (1939),
/// `1/√f = −2 log10(ε/(3.7 D) + 2.51/(Re √f))`, solved to machine precision; with ε = 0 this is Prandtl's law of the
/// smooth pipe. `relative_roughness` is ε/D. The sign of `reynolds` does not matter; at rest the laminar factor has no
/// finite value and infinity comes back (the loss itself vanishes: use a laminar formula in V there).
pub fn darcy_friction_factor(reynolds: f64, relative_roughness: f64) -> f64 {
    let re = reynolds.abs();
    if re <= LAMINAR_REYNOLDS { 64.0 / re } else { turbulent_friction_factor(re, relative_roughness) }
}

/// The Darcy factor of turbulent flow, as [`darcy_friction_factor`]. No flow is turbulent below a Reynolds number of
/// 1000, where the law ends at a pole: a fit that takes a turbulent flow for almost none on its way gets the factor
/// of 1000.
pub fn turbulent_friction_factor(reynolds: f64, relative_roughness: f64) -> f64 {
    let re = reynolds.abs().max(LEAST_TURBULENT_REYNOLDS);
    // Newton's method on x = 1/√f: the residual x + 2 log10(a + b x) is increasing and concave, so it converges from
    // any start; Swamee & Jain's explicit formula (within 1-3 %) leaves two or three steps to do.
    let a = relative_roughness.max(0.0) / 3.7;
    let b = 2.51 / re;
    let mut x = -2.0 * (a + 5.74 / re.powf(0.9)).log10();
    for _ in 0..20 {
        let inner = a + b * x;
        let step = (x + 2.0 * inner.log10()) / (1.0 + 2.0 * b / (inner * std::f64::consts::LN_10));
        x -= step;
        if step.abs() <= 1e-14 * x {
            break;
        }
    }
    1.0 / (x * x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn laminar_flow_follows_hagen_poiseuille() {
        assert_eq!(darcy_friction_factor(1000.0, 0.01), 0.064);
        assert_eq!(darcy_friction_factor(-640.0, 0.0), 0.1);
    }

    /// Prandtl's law of the smooth pipe as tabulated in textbooks (Schlichting; White).
    #[test]
    fn smooth_pipe_follows_prandtl() {
        for (re, published) in [(1e4, 0.0309), (1e5, 0.0180), (1e6, 0.0116), (1e7, 0.0081)] {
            let f = darcy_friction_factor(re, 0.0);
            assert!((f - published).abs() < 6e-5, "Re {re}: {f} against {published}");
        }
    }

    /// Fully rough flow on Moody's diagram (von Kármán), and White's example of an asphalted pipe (Re 270 000,
    /// ε/D 0.0008).
    #[test]
    fn agrees_with_moody_diagram() {
        for (re, roughness, moody) in
            [(1e9, 0.05, 0.0716), (1e9, 0.01, 0.0379), (1e9, 0.001, 0.0196), (1e9, 1e-4, 0.0120), (2.7e5, 8e-4, 0.0198)]
        {
            let f = darcy_friction_factor(re, roughness);
            assert!((f / moody - 1.0).abs() < 0.01, "Re {re}, e/D {roughness}: {f} against {moody}");
        }
    }

    #[test]
    fn a_turbulent_flow_that_has_almost_stopped_has_a_finite_factor() {
        for re in [0.0, 1.0, 5.0, 5.74_f64.powf(1.0 / 0.9), 100.0] {
            assert_eq!(turbulent_friction_factor(re, 0.0), turbulent_friction_factor(1000.0, 0.0), "Re {re}");
        }
        let factor = turbulent_friction_factor(1000.0, 0.0);
        assert!(factor > turbulent_friction_factor(2000.0, 0.0) && factor < 0.07, "{factor}");
    }

    #[test]
    fn solves_colebrook_everywhere() {
        for re in [2321.0, 4e3, 1e4, 1e6, 1e9] {
            for roughness in [0.0, 1e-6, 1e-3, 0.05] {
                let x = 1.0 / darcy_friction_factor(re, roughness).sqrt();
                let residual = x + 2.0 * (roughness / 3.7 + 2.51 * x / re).log10();
                assert!(residual.abs() < 1e-12, "Re {re}, e/D {roughness}: residual {residual}");
            }
        }
    }
}
