//! How retardation times depend on temperature: Arrhenius' law, and that of Williams, Landel and Ferry.
//!
//! `ln a_T = (E/R)(1/T - 1/T_ref)`; `log10 a_T = -C1 (T - T_ref)/(C2 + T - T_ref)` (Ferry 1980, ch. 11; J. Am. Chem.
//! Soc. 77:3701, 1955).

use nalgebra::{DMatrix, DVector};

use crate::creep::thresholds::{MAX_C2_K, WLF_LIMITS};
use crate::fit::numeric::least_squares::{Problem, minimise};
use crate::number::significant;

/// Gas constant, J/(mol K).
pub(crate) const GAS_CONSTANT: f64 = 8.314_462_618;
/// 0 °C, K.
pub(crate) const ZERO_DEGC_K: f64 = 273.15;

/// The shift factor of one temperature: `τ_k(T) = a_T τ_k(T_ref)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftFactor {
    /// Temperature, °C.
    pub temperature_degc: f64,
    /// a_T.
    pub factor: f64,
    /// Standard error of its logarithm.
    pub relative_error: f64,
}

/// See the module.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arrhenius {
    /// Activation energy E, J/mol.
    pub activation_j_mol: f64,
    /// Its standard error, J/mol; widened by what the law leaves of the factors.
    pub standard_error_j_mol: f64,
    /// Root mean square of what it leaves of `log10 a_T`.
    pub rms_decades: f64,
    /// It describes the factors within their errors (by χ² at 1%); none where there is but one, which any energy
    /// describes.
    pub describes: Option<bool>,
}

impl Arrhenius {
    /// a_T between two temperatures, °C.
    pub fn factor(activation_j_mol: f64, reference_degc: f64, temperature_degc: f64) -> f64 {
        (activation_j_mol / GAS_CONSTANT * inverse_difference(reference_degc, temperature_degc)).exp()
    }
}

/// See the module.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wlf {
    /// C1.
    pub c1: f64,
    /// C2, K.
    pub c2_k: f64,
    /// Standard errors of both.
    pub standard_errors: [f64; 2],
    /// Root mean square of what it leaves of `log10 a_T`.
    pub rms_decades: f64,
}

/// `1/T - 1/T_ref`, 1/K.
fn inverse_difference(reference_degc: f64, degc: f64) -> f64 {
    1.0 / (degc + ZERO_DEGC_K) - 1.0 / (reference_degc + ZERO_DEGC_K)
}

/// The laws of some shift factors, whose logarithms have this covariance; warnings go into `remarks`.
pub(crate) fn laws(
    reference_degc: f64,
    shifts: &[ShiftFactor],
    covariance: &DMatrix<f64>,
    remarks: &mut Vec<String>,
) -> (Option<Arrhenius>, Option<Wlf>) {
    // Rows of the inverse Cholesky factor make the logarithms' errors independent and of size one.
    let Some(whiten) = covariance.clone().cholesky().and_then(|c| c.l().try_inverse()) else {
        if !shifts.is_empty() {
            remarks.push("the shift factors are not all determined, so no law is fitted to them".into());
        }
        return (None, None);
    };
    let logs = DVector::from_iterator(shifts.len(), shifts.iter().map(|s| s.factor.ln()));
    if shifts.is_empty() {
        return (None, None);
    }
    let arrhenius = arrhenius(reference_degc, shifts, &whiten, &logs);
    if arrhenius.describes == Some(false) {
        remarks.push(format!(
            "Arrhenius' law does not describe the shift factors within their errors (it leaves {} decades): trust the factors, not the law",
            significant(arrhenius.rms_decades, 2)
        ));
    }
    if arrhenius.activation_j_mol < 0.0 {
        remarks.push(
            "by these factors a warmer wall creeps more slowly: check which temperature belongs to which file".into(),
        );
    }
    let wlf = (shifts.len() >= 2).then(|| wlf(reference_degc, shifts, &whiten, &logs)).flatten();
    if shifts.len() >= 2 && wlf.is_none() {
        remarks.push(
            "log a_T is nearly linear in temperature, or bends the other way: C1 and C2 of the law of Williams, Landel and Ferry stay \
             open"
                .into(),
        );
    }
    (Some(arrhenius), wlf)
}

fn rms_decades(left: &DVector<f64>) -> f64 {
    left.norm() / (left.len() as f64).sqrt() / 10f64.ln()
}

fn arrhenius(reference_degc: f64, shifts: &[ShiftFactor], whiten: &DMatrix<f64>, logs: &DVector<f64>) -> Arrhenius {
    let basis = shifts.iter().map(|s| inverse_difference(reference_degc, s.temperature_degc) / GAS_CONSTANT);
    let basis = DVector::from_iterator(shifts.len(), basis);
    let (x, y) = (whiten * &basis, whiten * logs);
    let activation_j_mol = x.dot(&y) / x.norm_squared();
    let square = (&y - &x * activation_j_mol).norm_squared();
    let freedom = shifts.len() - 1;
    let spread = if freedom > 0 { (square / freedom as f64).max(1.0) } else { 1.0 };
    Arrhenius {
        activation_j_mol,
        standard_error_j_mol: (spread / x.norm_squared()).sqrt(),
        rms_decades: rms_decades(&(logs - basis * activation_j_mol)),
        describes: (freedom > 0).then(|| square <= chi_square_99(freedom as f64)),
    }
}

/// The 99% point of χ² (Wilson & Hilferty 1931; within 2%).
fn chi_square_99(freedom: f64) -> f64 {
    let part = 2.0 / (9.0 * freedom);
    freedom * (1.0 - part + 2.3263 * part.sqrt()).powi(3)
}

/// `[ln C1, ln C2]` to whitened logarithms.
struct WlfProblem<'a> {
    differences_k: Vec<f64>,
    whiten: &'a DMatrix<f64>,
    logs: &'a DVector<f64>,
    lower: [f64; 2],
    upper: [f64; 2],
}

impl WlfProblem<'_> {
    fn left(&self, x: &[f64]) -> DVector<f64> {
        let (c1, c2) = (x[0].exp(), x[1].exp());
        let law = self.differences_k.iter().map(|d| -10f64.ln() * c1 * d / (c2 + d));
        self.logs - DVector::from_iterator(self.logs.len(), law)
    }
}

impl Problem for WlfProblem<'_> {
    type Error = std::convert::Infallible;
    fn residuals(&self, x: &[f64]) -> Result<Vec<f64>, Self::Error> {
        Ok((self.whiten * self.left(x)).iter().copied().collect())
    }
    fn bounds(&self) -> (&[f64], &[f64]) {
        (&self.lower, &self.upper)
    }
    fn difference_step(&self, _j: usize) -> f64 {
        1e-7
    }
}

/// None where its constants are not determined.
fn wlf(reference_degc: f64, shifts: &[ShiftFactor], whiten: &DMatrix<f64>, logs: &DVector<f64>) -> Option<Wlf> {
    let differences_k: Vec<f64> = shifts.iter().map(|s| s.temperature_degc - reference_degc).collect();
    // The pole lies below the coldest test.
    let least_c2_k = 1.0 - differences_k.iter().copied().fold(0.0, f64::min);
    let bounds = [(1e-3, 1e6), (least_c2_k, MAX_C2_K)].map(|(l, u): (f64, f64)| (l.ln(), u.ln()));
    let problem = WlfProblem { differences_k, whiten, logs, lower: bounds.map(|b| b.0), upper: bounds.map(|b| b.1) };
    let starts = [20.0f64, 60.0, 200.0, 600.0].map(|c2| [(0.05 * c2).ln(), (c2 + least_c2_k).ln()]);
    let solved = starts.iter().map(|start| match minimise(&problem, start, WLF_LIMITS, |_, _| {}) {
        Ok(solution) => solution,
        Err(never) => match never {},
    });
    let best = solved.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    if best.at_bound.contains(&true) {
        return None;
    }
    let covariance = best.normal.clone().try_inverse()?;
    let spread = if shifts.len() > 2 { (2.0 * best.cost / (shifts.len() - 2) as f64).max(1.0) } else { 1.0 };
    let (c1, c2_k) = (best.x[0].exp(), best.x[1].exp());
    let error = |j: usize| (covariance[(j, j)] * spread).sqrt();
    let relative = [error(0), error(1)];
    // Errors as large as the constants themselves leave them open.
    if relative.iter().any(|e| !e.is_finite() || *e > 1.0) {
        return None;
    }
    Some(Wlf {
        c1,
        c2_k,
        standard_errors: [c1 * relative[0], c2_k * relative[1]],
        rms_decades: rms_decades(&problem.left(&best.x)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factors(of: impl Fn(f64) -> f64) -> Vec<ShiftFactor> {
        let at = [30.0, 40.0, 50.0, 60.0];
        at.map(|t| ShiftFactor { temperature_degc: t, factor: of(t), relative_error: 0.01 }).to_vec()
    }

    fn covariance() -> DMatrix<f64> {
        DMatrix::from_diagonal_element(4, 4, 1e-4)
    }

    #[test]
    fn each_law_is_read_back_from_its_own_factors() {
        let mut remarks = Vec::new();
        let own = factors(|t| Arrhenius::factor(90e3, 20.0, t));
        let (found, _) = laws(20.0, &own, &covariance(), &mut remarks);
        let found = found.unwrap();
        assert!((found.activation_j_mol / 90e3 - 1.0).abs() < 1e-9 && found.describes == Some(true), "{found:?}");
        // One factor alone, of error 0.01, at 30 °C: 0.01 R/(1/T_ref - 1/T).
        let (single, none) = laws(20.0, &own[..1], &covariance().remove_rows(1, 3).remove_columns(1, 3), &mut remarks);
        let expected = 0.01 * GAS_CONSTANT / inverse_difference(20.0, 30.0).abs();
        assert!((single.unwrap().standard_error_j_mol / expected - 1.0).abs() < 1e-9);
        assert!(single.unwrap().describes.is_none() && none.is_none());
        let own = factors(|t| 10f64.powf(-8.86 * (t - 20.0) / (101.6 + t - 20.0)));
        let mut remarks = Vec::new();
        let (wrong, found) = laws(20.0, &own, &covariance(), &mut remarks);
        let found = found.unwrap();
        assert!((found.c1 / 8.86 - 1.0).abs() < 1e-4 && (found.c2_k / 101.6 - 1.0).abs() < 1e-4, "{found:?}");
        assert_eq!(wrong.unwrap().describes, Some(false));
        assert!(remarks.iter().any(|r| r.contains("Arrhenius' law does not describe")), "{remarks:?}");
    }

    #[test]
    fn temperatures_in_the_wrong_order_are_noticed() {
        let mut remarks = Vec::new();
        let (found, wlf) = laws(20.0, &factors(|t| Arrhenius::factor(-50e3, 20.0, t)), &covariance(), &mut remarks);
        assert!(found.unwrap().activation_j_mol < 0.0 && wlf.is_none());
        assert!(remarks.iter().any(|r| r.contains("a warmer wall creeps more slowly")), "{remarks:?}");
    }
}
