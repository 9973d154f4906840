//! Warnings about the fit of creep tests.

use crate::creep::Creep;
use crate::creep::ladder::{Ladder, Step};
use crate::creep::outcome::{CreepFit, TestFit};
use crate::creep::problem::Shifted;
use crate::creep::thresholds::{ALIKE_INFLATION, CONTRADICTING_NOISE, CREEPING_SHARE, MATERIAL_MARGIN};
use crate::creep::thresholds::{MAX_ELEMENTS, OPEN_ERROR};
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::number::significant;
use crate::rig::material::MATERIALS;

/// Adds sentences: `room` elements could be tried at the most; `most_taken` if evidence chose as many as were tried;
/// `asked` if their number was given.
pub(crate) fn remark(fit: &mut CreepFit, ladder: &Ladder, step: &Step, (room, most_taken): (usize, bool), asked: bool) {
    let chosen = fit.creep.elements.len();
    let (shortest_s, longest_s) = fit.span_s();
    let none = fit.creep.elements.is_empty();
    fit.remarks.extend(implausible(&fit.creep));
    if most_taken && chosen < MAX_ELEMENTS {
        fit.remarks
            .push(format!("there are too few samples to try more than {chosen} elements: read more often, or longer"));
    } else if most_taken {
        fit.remarks.push(format!(
            "more than {MAX_ELEMENTS} elements are not tried: the spectrum is broad, and these elements stand for it within the test's times alone"
        ));
    } else if none && !asked && fit.inflation > ALIKE_INFLATION {
        fit.remarks.push(
            "no creep describes these readings, which fall, jump or start long after the load: check them against the file's description".into(),
        );
    } else if none && !asked {
        fit.remarks.push("no creep shows above the noise: the material is elastic as far as this test shows".into());
    }
    for (k, e) in fit.creep.elements.iter().enumerate() {
        let at_bound = fit.at_bound[1 + 2 * k] || fit.at_bound[2 + 2 * k];
        if e.tau_s > longest_s {
            fit.remarks.push(format!(
                "element {} is slower ({:.3e} s) than the test lasted ({longest_s:.3e} s): the test shows its rate, J/tau, but not the two \
                 apart; test longer",
                k + 1,
                e.tau_s
            ));
        } else if e.tau_s < shortest_s {
            fit.remarks.push(format!(
                "element {} is faster ({:.3e} s) than the first sample ({shortest_s:.3e} s): what it shares with J0 stays open",
                k + 1,
                e.tau_s
            ));
        } else if !at_bound && fit.relative_errors[1 + 2 * k..=2 + 2 * k].iter().any(|e| *e > OPEN_ERROR) {
            fit.remarks.push(format!("element {} is not determined by these readings: ask for fewer elements", k + 1));
        } else if at_bound {
            fit.remarks.push(format!("element {} ended at a bound of the fit: ask for fewer elements", k + 1));
        }
    }
    if fit.inflation > ALIKE_INFLATION {
        fit.remarks.push(format!(
            "neighbouring residuals are correlated, so {} samples count as one: errors and band are widened for it; a drift of gauge or \
             temperature, or a load that changed, causes it",
            significant(fit.inflation, 2)
        ));
    }
    if ladder.shifts > 0 {
        apart(fit, ladder, step, room);
    }
    // with too few elements each test is left far from its noise, whatever the others show
    fit.remarks.extend(unlike(fit).filter(|_| !asked));
}

/// Where tests that were fitted as of one temperature contradict each other.
fn unlike(fit: &CreepFit) -> Option<String> {
    let ratio = |t: &TestFit| t.rms_per_pa / t.noise_per_pa;
    let worst = fit.tests.iter().max_by(|a, b| ratio(a).total_cmp(&ratio(b)))?;
    (fit.tests.len() > 1 && fit.shifts.is_empty() && ratio(worst) > CONTRADICTING_NOISE).then(|| {
        format!(
            "these tests are fitted as tests at one temperature and contradict each other: {} is left at {:.1} times its noise; where they were made \
             at several temperatures say option `temperature_degC` T1,T2,…, one a file",
            worst.test.file,
            ratio(worst)
        )
    })
}

/// A warning about a compliance that no wall of the library has. Metals do not creep.
fn implausible(creep: &Creep) -> Option<String> {
    let of = |viscoelastic: bool| {
        let known = MATERIALS.iter().filter(move |m| m.viscoelastic == viscoelastic);
        let per_gpa = known.flat_map(|m| m.youngs_modulus_range_pa).map(|pa| 1e9 / pa);
        per_gpa.fold((f64::INFINITY, 0.0), |(l, u): (f64, f64), j| (l.min(j), u.max(j)))
    };
    let (plastics, metals) = (of(true), of(false));
    let retarded: f64 = creep.elements.iter().map(|e| e.compliance_per_pa).sum();
    let creeps = retarded > CREEPING_SHARE * creep.instantaneous_per_pa;
    let least = if creeps { plastics.0 } else { metals.0 };
    let j0_per_gpa = 1e9 * creep.instantaneous_per_pa;
    let plausible = least / MATERIAL_MARGIN..=plastics.1 * MATERIAL_MARGIN;
    (!plausible.contains(&j0_per_gpa)).then(|| {
        format!(
            "J0 = {} 1/GPa would be a modulus of {} GPa{}; walls that creep have {} to {} 1/GPa (glass fibre to soft \
             polyethylene), metals {} to {}: check the unit in the column's name, and the stress",
            significant(j0_per_gpa, 3),
            significant(1.0 / j0_per_gpa, 3),
            if creeps { " of a wall that creeps" } else { "" },
            significant(plastics.0, 2),
            significant(plastics.1, 2),
            significant(metals.0, 2),
            significant(metals.1, 2)
        )
    })
}

/// Warns where separate fits, one for each temperature, describe the tests better than shifted times.
fn apart(fit: &mut CreepFit, ladder: &Ladder, step: &Step, room: usize) {
    let (mut square, mut variables, mut effective, mut worst) = (0.0, 0, 0.0, (0.0, String::new()));
    for group in std::iter::once(None).chain((0..ladder.shifts).map(Some)) {
        let of_group = |(t, _): &(&Shifted, &TestFit)| t.shift == group;
        let own: Vec<_> = ladder.tests.iter().zip(&fit.tests).filter(of_group).collect();
        let alone = own.iter().map(|(t, _)| Shifted { samples: t.samples.clone(), shift: None }).collect();
        let alone = Ladder::new(alone, &[]);
        let steps = alone.climb(0, room.min(alone.samples() / 4));
        let Some(best) = steps.iter().min_by(|a, b| a.bic.total_cmp(&b.bic)) else { continue };
        let together: f64 = own
            .iter()
            .flat_map(|(t, f)| {
                let left = f.test.compliance_per_pa.iter().zip(&f.fitted_per_pa).zip(&t.samples.sd_per_pa);
                left.map(|((j, f), sd)| ((j - f) / sd).powi(2))
            })
            .sum();
        square += 2.0 * best.solution.cost;
        variables += alone.variables(best.creep.elements.len());
        // The separate fits give the noise, for the shift is on trial.
        effective += alone.samples() as f64 / alone.reading_noise(best).inflation().clamp(1.0, 20.0);
        let ratio = (together / (2.0 * best.solution.cost).max(f64::MIN_POSITIVE)).sqrt();
        if ratio > worst.0 {
            worst = (ratio, own.first().map_or(String::new(), |(_, f)| f.test.file.clone()));
        }
    }
    let n = ladder.samples() as f64;
    let together = ladder.variables(step.creep.elements.len()) as f64;
    let gain = effective * (2.0 * step.solution.cost / n).max(0.1).ln() - effective * (square / n).max(0.1).ln();
    if 0.5 * (gain - (variables as f64 - together) * effective.ln()) > STRONG_EVIDENCE {
        fit.remarks.push(format!(
            "a shift of times does not describe these tests: fitted apart they leave less, {} by {:.2} times; compliances change with \
             temperature too, or loads and specimens differ",
            worst.1, worst.0
        ));
    }
}
