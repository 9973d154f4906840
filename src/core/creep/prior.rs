//! The prior that a creep test gives a calibration: of the elements that a surge can show.
//!
//! An element much slower than the surge does not move during it, and one much faster looks like the instantaneous
//! modulus, which the wave speed already includes: neither is a parameter of the surge. The others get a lognormal
//! prior for J and for τ.
//!
//! A laboratory's first reading is a tenth of a second or more after the load, later than much that a surge shows.
//! Faster elements are part of the test's J0, which says little about the wave speed and is not used for it. Elements
//! faster than the first reading may still be added, with a prior that they are no slower.

use crate::creep::CreepError;
use crate::creep::file::{CreepFile, ElementTable};
use crate::creep::thresholds::{SAME_TEMPERATURE_K, WIDEST_PRIOR};
use crate::fit::problem::thresholds::VISIBLE_TIMES_PERIODS;
use crate::model::prior::Prior;
use crate::number::significant;

/// The prior of the wall.
#[derive(Debug, Clone, PartialEq)]
pub struct WallPrior {
    /// Number of elements that the test shows; they are the model's first.
    pub elements: usize,
    /// Whether the surge may show faster ones, which the test has in its J0.
    pub faster: bool,
    /// Of `J1_per_GPa`, `tau1_s`, … of these, and of the retardation times of any faster ones.
    pub priors: Vec<Prior>,
    /// Sentences on what was used, what was left out, and why.
    pub sentences: Vec<String>,
}

/// The prior of a wall in a surge of `period_s` at a water temperature. No standard deviation is less than `least_sd`,
/// relative: a slow test at larger strain is no surge. At most `most` elements.
///
/// # Errors
/// A test without an element that the surge can show, or with more than `most`.
pub fn wall_prior(
    file: &CreepFile,
    period_s: f64,
    water_degc: f64,
    least_sd: f64,
    most: usize,
) -> Result<WallPrior, CreepError> {
    let mut sentences = Vec::new();
    let factor = match (file.factor_at(water_degc), file.reference_degc) {
        (Some(factor), Some(reference)) if (reference - water_degc).abs() > SAME_TEMPERATURE_K => {
            sentences.push(format!(
                "the retardation times of the creep test at {reference} °C are multiplied by {factor:.3} for the water's {water_degc:.1} °C, by \
                 Arrhenius' law"
            ));
            factor
        }
        (None, Some(reference)) if (reference - water_degc).abs() > SAME_TEMPERATURE_K => {
            sentences.push(format!(
                "the creep test was made at {reference} °C, the water has {water_degc:.1} °C, and the shift with temperature is not known: its times \
                 are used as they are"
            ));
            1.0
        }
        _ => 1.0,
    };
    let (shortest_s, longest_s) = (VISIBLE_TIMES_PERIODS.0 * period_s, VISIBLE_TIMES_PERIODS.1 * period_s);
    let mut own: Vec<(usize, ElementTable)> = file.elements.iter().cloned().enumerate().collect();
    for (_, e) in &mut own {
        e.tau_s *= factor;
        e.tau_standard_error = e.tau_standard_error.map(|s| s * factor);
    }
    own.sort_by(|a, b| a.1.tau_s.total_cmp(&b.1.tau_s));
    for (k, e) in &own {
        let (k, j, tau_s) = (k + 1, e.j_per_gpa, e.tau_s);
        if tau_s > longest_s {
            sentences.push(format!(
                "element {k} of the creep test (J {j:.4} 1/GPa, tau {tau_s:.4e} s) is left out: slower than ten periods ({longest_s:.3} s), it \
                 does not move during a surge"
            ));
        } else if tau_s < shortest_s {
            sentences.push(format!(
                "element {k} of the creep test (J {j:.4} 1/GPa, tau {tau_s:.4e} s) is left out: faster than a hundredth of a period \
                 ({shortest_s:.4} s), it belongs to the instantaneous modulus, which the wave speed holds"
            ));
        }
    }
    own.retain(|(_, e)| (shortest_s..=longest_s).contains(&e.tau_s));
    if own.is_empty() {
        let all = file
            .elements
            .iter()
            .map(|e| format!("{} s", significant(e.tau_s * factor, 3)))
            .collect::<Vec<_>>()
            .join(", ");
        let found = if all.is_empty() { "no element".into() } else { all };
        return Err(CreepError::NoneInReach { period_s, shortest_s, longest_s, found });
    }
    if own.len() > most {
        return Err(CreepError::TooManyInReach { found: own.len(), most });
    }
    let sd = |value: f64, error: Option<f64>| {
        error.map_or(WIDEST_PRIOR, |e| (e / value).max(least_sd).min(WIDEST_PRIOR.max(least_sd)))
    };
    let priors = own.iter().enumerate().flat_map(|(i, (_, e))| {
        let n = i + 1;
        [
            Prior { name: format!("J{n}_per_GPa"), mean: e.j_per_gpa, sd: sd(e.j_per_gpa, e.j_standard_error) },
            Prior { name: format!("tau{n}_s"), mean: e.tau_s, sd: sd(e.tau_s, e.tau_standard_error) },
        ]
    });
    let mut priors: Vec<Prior> = priors.collect();
    for pair in priors.chunks_exact(2) {
        sentences.push(format!(
            "known from the creep test: {} = {:.4} to {:.0}%, {} = {:.4} to {:.0}%",
            pair[0].name,
            pair[0].mean,
            100.0 * pair[0].sd,
            pair[1].name,
            pair[1].mean,
            100.0 * pair[1].sd
        ));
    }
    let first_s = file.seen_s[0] * factor;
    let faster = shortest_s < first_s && own.len() < most;
    if faster {
        sentences.push(format!(
            "the creep test's first reading is at {first_s:.3} s: faster creep is part of its J0, and the surge may show it; faster elements are \
             added after the test's own (tau{} to {first_s:.3} s) while the record supports them",
            own.len() + 1
        ));
        // Two standard deviations either way.
        let (mean, sd) = ((shortest_s * first_s).sqrt(), (0.25 * (first_s / shortest_s).ln()).max(least_sd));
        priors.extend((own.len() + 1..=most).map(|n| Prior { name: format!("tau{n}_s"), mean, sd }));
    }
    Ok(WallPrior { elements: own.len(), faster, priors, sentences })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(tau_s: &[f64]) -> CreepFile {
        let element = |&tau_s: &f64| ElementTable {
            j_per_gpa: 0.2,
            j_standard_error: Some(0.002),
            tau_s,
            tau_standard_error: Some(0.5 * tau_s),
        };
        CreepFile {
            files: vec!["a.csv".into()],
            reference_degc: Some(20.0),
            j0_per_gpa: 0.7,
            j0_standard_error: None,
            seen_s: [0.01, 3600.0],
            rms_per_gpa: 0.01,
            shift: None,
            elements: tau_s.iter().map(element).collect(),
        }
    }

    #[test]
    fn a_surge_knows_what_lies_in_its_reach_and_says_what_does_not() {
        let known = wall_prior(&file(&[0.001, 0.05, 2.0, 500.0]), 1.0, 20.0, 0.1, 5).unwrap();
        assert_eq!(known.elements, 2);
        let names: Vec<&str> = known.priors.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["J1_per_GPa", "tau1_s", "J2_per_GPa", "tau2_s"]);
        // 1% of the test is widened, 50% is kept.
        assert_eq!((known.priors[0].sd, known.priors[1].sd, known.priors[3].mean), (0.1, 0.5, 2.0));
        let sentences = known.sentences.join("\n");
        assert!(sentences.contains("element 1 of") && sentences.contains("instantaneous modulus"), "{sentences}");
        assert!(
            sentences.contains("element 4 of") && sentences.contains("does not move during a surge"),
            "{sentences}"
        );
        assert!(!known.faster, "the first reading is at a hundredth of the period");
        let none = wall_prior(&file(&[500.0]), 1.0, 20.0, 0.1, 5).unwrap_err().to_string();
        assert!(none.contains("none of the elements") && none.contains("500 s"), "{none}");
        let many = wall_prior(&file(&[0.05, 0.1, 0.2]), 1.0, 20.0, 0.1, 2).unwrap_err();
        assert_eq!(many, CreepError::TooManyInReach { found: 3, most: 2 });
    }

    /// Read from 0.3 s on in a surge of 1 s: from 0.01 s to there elements are free, those of the test are not.
    #[test]
    fn what_is_faster_than_the_first_reading_stays_free() {
        let late = CreepFile { seen_s: [0.3, 3600.0], ..file(&[2.0, 500.0]) };
        let known = wall_prior(&late, 1.0, 20.0, 0.1, 3).unwrap();
        assert!(known.faster && known.elements == 1);
        let names: Vec<&str> = known.priors.iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["J1_per_GPa", "tau1_s", "tau2_s", "tau3_s"]);
        let free = &known.priors[2];
        assert!(
            (free.mean * (-2.0 * free.sd).exp() - 0.01).abs() < 1e-9
                && (free.mean * (2.0 * free.sd).exp() - 0.3).abs() < 1e-9
        );
        assert!(known.sentences.join("\n").contains("first reading is at 0.300 s"), "{:?}", known.sentences);
    }

    #[test]
    fn times_follow_the_temperature_where_a_law_is_known() {
        let mut known = file(&[2.0]);
        let sentences = wall_prior(&known, 1.0, 30.0, 0.1, 5).unwrap().sentences.join("\n");
        assert!(sentences.contains("shift with temperature is not known"), "{sentences}");
        known.shift = Some(crate::creep::file::ShiftTable {
            activation_kj_mol: Some(100.0),
            activation_standard_error: None,
            temperature_degc: vec![30.0],
            factor: vec![0.26],
        });
        let prior = wall_prior(&known, 1.0, 30.0, 0.1, 5).unwrap();
        // exp(1e5/8.314 (1/303.15 - 1/293.15))
        assert!((prior.priors[1].mean / (2.0 * 0.258_4) - 1.0).abs() < 1e-3, "{prior:?}");
    }
}
