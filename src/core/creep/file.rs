//! The result of a creep test on disk: `CREEP.toml`.

use serde::{Deserialize, Serialize};

use crate::creep::CreepError;
use crate::creep::outcome::CreepFit;
use crate::creep::shift::Arrhenius;

/// First line of such a file.
pub const HEADING: &str = "# surgescope creep test";

/// See the module. Standard errors are left out where the test does not determine them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CreepFile {
    /// The tests that it was fitted to.
    pub files: Vec<String>,
    /// Temperature that elements and J0 belong to, °C.
    #[serde(rename = "reference_degC", skip_serializing_if = "Option::is_none")]
    pub reference_degc: Option<f64>,
    /// J0, 1/GPa, with all that is faster than the first reading.
    #[serde(rename = "J0_per_GPa")]
    pub j0_per_gpa: f64,
    /// Its standard error.
    #[serde(rename = "J0_standard_error", skip_serializing_if = "Option::is_none")]
    pub j0_standard_error: Option<f64>,
    /// First and last reduced time of the samples, s.
    pub seen_s: [f64; 2],
    /// Root mean square of the residuals over all samples, 1/GPa.
    #[serde(rename = "rms_per_GPa")]
    pub rms_per_gpa: f64,
    /// How the times go with temperature.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shift: Option<ShiftTable>,
    /// The elements, by retardation time.
    #[serde(default, rename = "element")]
    pub elements: Vec<ElementTable>,
}

/// One element.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ElementTable {
    /// J_k, 1/GPa.
    #[serde(rename = "J_per_GPa")]
    pub j_per_gpa: f64,
    /// Its standard error.
    #[serde(rename = "J_standard_error", skip_serializing_if = "Option::is_none")]
    pub j_standard_error: Option<f64>,
    /// τ_k, s.
    pub tau_s: f64,
    /// Its standard error.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tau_standard_error: Option<f64>,
}

/// Arrhenius' law, and the factors themselves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShiftTable {
    /// Activation energy, kJ/mol.
    #[serde(rename = "activation_kJ_mol", skip_serializing_if = "Option::is_none")]
    pub activation_kj_mol: Option<f64>,
    /// Its standard error.
    #[serde(rename = "activation_standard_error", skip_serializing_if = "Option::is_none")]
    pub activation_standard_error: Option<f64>,
    /// Temperatures tested beside the reference, °C.
    #[serde(rename = "temperature_degC")]
    pub temperature_degc: Vec<f64>,
    /// a_T of each.
    pub factor: Vec<f64>,
}

impl CreepFile {
    /// Of a fit.
    pub fn of(fit: &CreepFit) -> Self {
        let error = |value: f64, j: usize| Some(value * fit.relative_errors[j]).filter(|e| e.is_finite());
        let per_gpa = |per_pa: f64| per_pa * 1e9;
        let elements = fit.creep.elements.iter().enumerate().map(|(k, e)| ElementTable {
            j_per_gpa: per_gpa(e.compliance_per_pa),
            j_standard_error: error(per_gpa(e.compliance_per_pa), 1 + 2 * k),
            tau_s: e.tau_s,
            tau_standard_error: error(e.tau_s, 2 + 2 * k),
        });
        let shift = (!fit.shifts.is_empty()).then(|| ShiftTable {
            activation_kj_mol: fit.arrhenius.map(|a| a.activation_j_mol * 1e-3),
            activation_standard_error: fit.arrhenius.map(|a| a.standard_error_j_mol * 1e-3),
            temperature_degc: fit.shifts.iter().map(|s| s.temperature_degc).collect(),
            factor: fit.shifts.iter().map(|s| s.factor).collect(),
        });
        let j0_per_gpa = per_gpa(fit.creep.instantaneous_per_pa);
        CreepFile {
            files: fit.tests.iter().map(|t| t.test.file.clone()).collect(),
            reference_degc: fit.reference_degc,
            j0_per_gpa,
            j0_standard_error: error(j0_per_gpa, 0),
            seen_s: [fit.span_s().0, fit.span_s().1],
            rms_per_gpa: per_gpa(fit.rms_per_pa()),
            shift,
            elements: elements.collect(),
        }
    }

    /// From the text of a file; `name` is for messages.
    ///
    /// # Errors
    /// [`CreepError::File`]: one that is no such file, or with values that no creep test gives.
    pub fn parse(text: &str, name: &str) -> Result<Self, CreepError> {
        let wrong = |problem: String| CreepError::File { file: name.to_owned(), problem };
        let file: CreepFile = toml::from_str(text).map_err(|e| wrong(e.to_string()))?;
        let positive = |v: f64| v > 0.0 && v.is_finite();
        for (k, e) in file.elements.iter().enumerate() {
            if !positive(e.j_per_gpa) || !positive(e.tau_s) {
                return Err(wrong(format!("element {} has a J or a tau that is not above 0", k + 1)));
            }
            if [e.j_standard_error, e.tau_standard_error].into_iter().flatten().any(|e| !positive(e)) {
                return Err(wrong(format!("element {} has a standard error that is not above 0", k + 1)));
            }
        }
        if !positive(file.j0_per_gpa) {
            return Err(wrong("J0_per_GPa is not above 0".into()));
        }
        Ok(file)
    }

    /// The text of the file.
    ///
    /// # Errors
    /// None in practice: all values can be written.
    pub fn text(&self) -> Result<String, toml::ser::Error> {
        let body = toml::to_string(self)?;
        Ok(format!(
            "{HEADING}: J(t) = J0 + sum of J_k (1 - exp(-t/tau_k)), times in s, compliances in 1/GPa;\n# J0 includes what is faster than \
             the first reading, seen_s[0]; at another temperature tau is tau_s times its shift factor. `surgescope calibrate --creep` and `surgescope diagnose --creep` take it as what is known of the wall.\n\n{body}"
        ))
    }

    /// Shift factor from the reference to a temperature, by the law; none where the file knows no law.
    pub fn factor_at(&self, temperature_degc: f64) -> Option<f64> {
        let activation_kj_mol = self.shift.as_ref()?.activation_kj_mol?;
        Some(Arrhenius::factor(activation_kj_mol * 1e3, self.reference_degc?, temperature_degc))
    }
}
