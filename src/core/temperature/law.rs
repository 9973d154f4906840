//! Laws of the temperature: from the parameters that all runs share to those of each run's model.

use crate::creep::shift::{Arrhenius, GAS_CONSTANT, ZERO_DEGC_K};
use crate::model::parameter::{Parameter, Scale};
use crate::rig::{Rig, WaterProperties};
use crate::temperature::thresholds::MAX_RATE_PER_K;

/// How retardation times shift with temperature, all by one factor: `tau_k(T) = a_T tau_k(T0)`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shift {
    /// `ln a_T = (Ea/R)(1/T - 1/T0)`.
    Arrhenius,
    /// `log10 a_T = -C1 (T - T0)/(C2 + T - T0)` (Williams, Landel & Ferry 1955).
    Wlf,
    /// A factor of its own for each run.
    Free,
}

impl Shift {
    /// As on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Shift::Arrhenius => "arrhenius",
            Shift::Wlf => "wlf",
            Shift::Free => "free",
        }
    }
}

/// The laws that connect the runs of a family.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Laws {
    /// Of the retardation times.
    pub shift: Shift,
    /// Each run has a modulus of its own; otherwise `ln E0` is linear in the temperature.
    pub modulus_free: bool,
    /// Compliances change with temperature, all by one factor whose logarithm is linear in it; otherwise they are the
    /// same in all runs.
    pub vertical: bool,
}

/// The role of a shared parameter in the laws.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// Of a pipe: its modulus and the water's give it.
    WaveSpeed(usize),
    Compliance,
    Retardation,
    /// No law: the same in all runs.
    Other,
}

/// Roles of shared parameters, wave speeds of `pipes` first.
pub(crate) fn roles(pipes: usize, names: &[&str]) -> Vec<Role> {
    let numbered = |name: &str, before: &str, after: &str| {
        let number = name.strip_prefix(before).and_then(|n| n.strip_suffix(after));
        number.is_some_and(|n| n.parse::<usize>().is_ok())
    };
    let role = |(j, name): (usize, &&str)| match j {
        _ if j < pipes => Role::WaveSpeed(j),
        _ if numbered(name, "J", "_per_GPa") => Role::Compliance,
        _ if numbered(name, "tau", "_s") => Role::Retardation,
        _ => Role::Other,
    };
    names.iter().enumerate().map(role).collect()
}

/// `(1/T - 1/T_ref)/R`, mol/J: the factor of an activation energy.
pub(crate) fn inverse_kelvin(reference_degc: f64, degc: f64) -> f64 {
    (1.0 / (degc + ZERO_DEGC_K) - 1.0 / (reference_degc + ZERO_DEGC_K)) / GAS_CONSTANT
}

/// The name of a pipe's modulus, from that of its wave speed.
pub(crate) fn modulus_name(wave_speed: &str) -> String {
    wave_speed.replace("wave_speed_m_s", "E0_GPa")
}

/// What a parameter of the laws does.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// Modulus behind a wave speed, of all runs at the reference or of one.
    Modulus(usize, Option<usize>),
    /// `d ln E/dT`.
    ModulusRate(usize),
    /// A shared parameter as it stands, compliances and times at the reference.
    Same(usize),
    ComplianceRate,
    Activation,
    C1,
    C2,
    /// `ln a_T` of a run.
    Factor(usize),
}

/// The laws of a family: parameters, and what they make of a temperature.
pub(crate) struct LawModel<'a> {
    rig: &'a Rig,
    roles: Vec<Role>,
    reference_degc: f64,
    /// Every parameter, described.
    pub parameters: Vec<Parameter>,
    kinds: Vec<Kind>,
}

impl<'a> LawModel<'a> {
    /// Of models with these `shared` parameters on runs at `temperatures`, called `files`.
    pub fn new(
        rig: &'a Rig,
        shared: &[Parameter],
        laws: Laws,
        reference_degc: f64,
        runs: &[(f64, String)],
    ) -> LawModel<'a> {
        let names: Vec<&str> = shared.iter().map(|p| p.name.as_str()).collect();
        let roles = roles(rig.pipes.len(), &names);
        let mut model = LawModel { rig, roles, reference_degc, parameters: Vec::new(), kinds: Vec::new() };
        for (j, parameter) in shared.iter().enumerate() {
            model.add_own(j, parameter, laws.modulus_free, runs);
        }
        if laws.vertical && model.roles.contains(&Role::Compliance) {
            let about = "relative change of all creep compliances per kelvin";
            model.rate("J_rate_per_K".into(), about, Kind::ComplianceRate);
        }
        if model.roles.contains(&Role::Retardation) {
            model.add_shift(laws.shift, runs);
        }
        model
    }

    fn add(&mut self, kind: Kind, parameter: Parameter) {
        self.kinds.push(kind);
        self.parameters.push(parameter);
    }

    fn rate(&mut self, name: String, about: &'static str, kind: Kind) {
        self.add(kind, Parameter::linear(name, "1/K", about, 0.0, -MAX_RATE_PER_K, MAX_RATE_PER_K));
    }

    fn add_own(&mut self, j: usize, parameter: &Parameter, modulus_free: bool, runs: &[(f64, String)]) {
        let Role::WaveSpeed(i) = self.roles[j] else {
            let mut own = Parameter { prior: None, ..parameter.clone() };
            if self.roles[j] == Role::Retardation {
                (own.lower, own.upper) = (own.lower / 10.0, own.upper * 10.0);
            }
            return self.add(Kind::Same(j), own);
        };
        let typical_gpa = 1e-9 * self.rig.pipes[i].material().youngs_modulus_pa;
        let modulus = |name: String| {
            let about = "instantaneous Young's modulus of the wall, by Korteweg's law";
            Parameter::log(name, "GPa", about, typical_gpa, 1e-3 * typical_gpa, 1e3 * typical_gpa)
        };
        let name = modulus_name(&parameter.name);
        if modulus_free {
            for (r, (_, file)) in runs.iter().enumerate() {
                self.add(Kind::Modulus(j, Some(r)), modulus(format!("{name}({file})")));
            }
        } else {
            let rate = name.replace("E0_GPa", "E0_rate_per_K");
            self.add(Kind::Modulus(j, None), modulus(name));
            self.rate(rate, "relative change of the modulus per kelvin", Kind::ModulusRate(j));
        }
    }

    fn add_shift(&mut self, shift: Shift, runs: &[(f64, String)]) {
        let coldest = runs.iter().map(|r| r.0).fold(f64::INFINITY, f64::min);
        match shift {
            Shift::Arrhenius => {
                let about = "activation energy of the retardation times";
                let energy = Parameter::linear("activation_kJ_mol", "kJ/mol", about, 0.0, -1000.0, 1000.0);
                self.add(Kind::Activation, energy);
            }
            Shift::Wlf => {
                let about = "constants of Williams, Landel and Ferry";
                // The pole lies below the coldest run.
                let least = 1.0 + (self.reference_degc - coldest).max(0.0);
                self.add(Kind::C1, Parameter::linear("WLF_C1", "1", about, 5.0, -1e4, 1e4));
                self.add(Kind::C2, Parameter::log("WLF_C2_K", "K", about, 150.0f64.max(2.0 * least), least, 1e4));
            }
            Shift::Free => {
                let near = |r: &usize| (runs[*r].0 - self.reference_degc).abs();
                let reference = (0..runs.len()).min_by(|a, b| near(a).total_cmp(&near(b)));
                for (r, (_, file)) in runs.iter().enumerate().filter(|(r, _)| Some(*r) != reference) {
                    let about = "logarithm of the factor of this run's retardation times";
                    let factor = Parameter::linear(format!("ln_a_T({file})"), "1", about, 0.0, -20.0, 20.0);
                    self.add(Kind::Factor(r), factor);
                }
            }
        }
    }

    /// Whether it also holds between the runs' temperatures.
    pub fn is_a_law(&self) -> bool {
        !self.kinds.iter().any(|k| matches!(k, Kind::Factor(_) | Kind::Modulus(_, Some(_))))
    }

    /// The model's shared parameters at a temperature, of `run` where a law is free; then the moduli behind the wave
    /// speeds, GPa.
    pub fn shared(
        &self,
        values: &[f64],
        degc: f64,
        water: &WaterProperties,
        run: Option<usize>,
    ) -> (Vec<f64>, Vec<f64>) {
        let warmer_k = degc - self.reference_degc;
        let mut shared = vec![0.0; self.roles.len()];
        let (mut ln_shift, mut ln_compliance, mut c1) = (0.0, 0.0, 0.0);
        for (kind, &value) in self.kinds.iter().zip(values) {
            match *kind {
                Kind::Modulus(j, own) if own.is_none() || own == run => shared[j] = value.ln(),
                // The modulus stands before its rate.
                Kind::ModulusRate(j) => shared[j] += value * warmer_k,
                Kind::Same(j) => shared[j] = value,
                Kind::ComplianceRate => ln_compliance = value * warmer_k,
                Kind::Activation => ln_shift = Arrhenius::factor(1e3 * value, self.reference_degc, degc).ln(),
                Kind::C1 => c1 = value,
                Kind::C2 => ln_shift = -c1 * 10f64.ln() * warmer_k / (value + warmer_k),
                Kind::Factor(r) if Some(r) == run => ln_shift = value,
                Kind::Factor(_) | Kind::Modulus(..) => {}
            }
        }
        let mut moduli = Vec::new();
        for (value, role) in shared.iter_mut().zip(&self.roles) {
            match role {
                Role::WaveSpeed(i) => {
                    let modulus_gpa = value.exp();
                    moduli.push(modulus_gpa);
                    *value = self.rig.pipes[*i].korteweg_wave_speed_m_s(water, modulus_gpa * 1e9);
                }
                Role::Compliance => *value *= ln_compliance.exp(),
                Role::Retardation => *value *= ln_shift.exp(),
                Role::Other => {}
            }
        }
        (shared, moduli)
    }
}

/// Whether a step of a value is one of its logarithm.
pub(crate) fn is_log(parameter: &Parameter) -> bool {
    parameter.scale == Scale::Log
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::model::effects::parse_list;

    const RIG: &str = include_str!("../../../rigs/paper-ppr.toml");

    /// By hand: E0 2 GPa at 20 °C falling 1% a K, 80 kJ/mol, compliances rising 0.5% a K, all at 40 °C.
    #[test]
    fn the_laws_give_what_a_calculator_gives() {
        let rig = Rig::from_toml(RIG, "rig.toml").unwrap();
        let water = rig.fluid.properties(40.0);
        let model = Model::new(&rig, &water, &parse_list("viscoelastic-wall:2").unwrap());
        let laws = Laws { shift: Shift::Arrhenius, modulus_free: false, vertical: true };
        let runs = [(20.0, "a".to_owned()), (40.0, "b".to_owned())];
        let law = LawModel::new(&rig, &model.shared, laws, 20.0, &runs);
        let names: Vec<&str> = law.parameters.iter().map(|p| p.name.as_str()).collect();
        let expected = "E0_GPa E0_rate_per_K J1_per_GPa tau1_s J2_per_GPa tau2_s J_rate_per_K activation_kJ_mol";
        assert_eq!(names.join(" "), expected);
        assert!(law.is_a_law());
        let values = [2.0, -0.01, 0.1, 0.02, 0.8, 1.1, 0.005, 80.0];
        let (shared, moduli) = law.shared(&values, 40.0, &water, Some(1));
        let factor = (80e3 / 8.314_462_618 * (1.0 / 313.15 - 1.0 / 293.15f64)).exp();
        let modulus = 2.0 * (-0.2f64).exp();
        let speed = rig.pipes[0].korteweg_wave_speed_m_s(&water, modulus * 1e9);
        let by_hand = [speed, 0.1 * 0.1f64.exp(), 0.02 * factor, 0.8 * 0.1f64.exp(), 1.1 * factor];
        assert!(shared.iter().zip(by_hand).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{shared:?} {by_hand:?}");
        assert!((moduli[0] / modulus - 1.0).abs() < 1e-12);
        // C1 17.44, C2 51.6 K (Ferry's universal constants): a_T 20 K above the reference.
        let wlf = LawModel::new(&rig, &model.shared, Laws { shift: Shift::Wlf, ..laws }, 20.0, &runs);
        let values = [2.0, 0.0, 0.1, 0.02, 0.8, 1.1, 0.0, 17.44, 51.6];
        let shifted = wlf.shared(&values, 40.0, &water, None).0[2];
        assert!((shifted / (0.02 * 10f64.powf(-17.44 * 20.0 / 71.6)) - 1.0).abs() < 1e-9);
        // Free: the run at the reference has no factor of its own.
        let free = LawModel::new(
            &rig,
            &model.shared,
            Laws { shift: Shift::Free, modulus_free: true, vertical: false },
            20.0,
            &runs,
        );
        assert!(!free.is_a_law());
        let values = [2.0, 1.5, 0.1, 0.02, 0.8, 1.1, 0.5f64.ln()];
        assert_eq!(free.parameters.len(), values.len());
        let (cold, warm) = (free.shared(&values, 20.0, &water, Some(0)), free.shared(&values, 40.0, &water, Some(1)));
        assert!((cold.0[2] - 0.02).abs() < 1e-15 && (warm.0[2] - 0.01).abs() < 1e-12);
        assert!((cold.1[0] - 2.0).abs() < 1e-12 && (warm.1[0] - 1.5).abs() < 1e-12);
    }
}
