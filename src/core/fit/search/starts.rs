//! Where fits start: from the rig's values, from what each effect proposes beside them, from a smaller model already
//! fitted.

use crate::fit::search::calibrator::Estimate;
use crate::model::Model;
use crate::model::effects::Chosen;
use crate::model::parameter::Scale;

/// Where a fit may start.
pub(crate) struct Start {
    /// Values of all variables.
    pub(crate) values: Vec<f64>,
    /// The parameters of the effect that proposes it; none for the model's own start.
    pub(crate) effect: std::ops::Range<usize>,
    /// One of the many starts of an effect that may be anywhere.
    pub(crate) of_many: bool,
}

/// Whether an effect proposes starts beside its usual one: its fit has several optima.
pub(crate) fn proposes_starts(chosen: &Chosen) -> bool {
    !chosen.effect.other_starts(chosen.elements.unwrap_or(1)).is_empty()
}

/// The start values and those that each effect proposes beside them.
pub(crate) fn starts_of(model: &Model, base: &[f64]) -> Vec<Start> {
    let mut starts = vec![Start { values: base.to_vec(), effect: 0..0, of_many: false }];
    let mut at = model.effects_from();
    for (chosen, &size) in model.effects.iter().zip(model.effect_sizes()) {
        let others = chosen.effect.other_starts(chosen.elements.unwrap_or(1));
        let of_many = chosen.effect.on_pipe();
        for factors in others {
            let mut values = base.to_vec();
            for (value, factor) in values[at..at + size].iter_mut().zip(factors) {
                *value *= factor;
            }
            starts.push(Start { values, effect: at..at + size, of_many });
        }
        at += size;
    }
    starts
}

/// `n` starts drawn at random, as a Latin hypercube over the ranges of the shared parameters.
pub(crate) fn drawn(model: &Model, base: &[f64], n: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut starts = vec![base.to_vec(); n];
    for (j, parameter) in model.shared.iter().enumerate().filter(|(_, p)| p.lower < p.upper) {
        let mut strata: Vec<usize> = (0..n).collect();
        random.shuffle(&mut strata);
        for (start, stratum) in starts.iter_mut().zip(strata) {
            let share = (stratum as f64 + random.f64()) / n as f64;
            start[j] = match parameter.scale {
                Scale::Linear => parameter.lower + share * (parameter.upper - parameter.lower),
                Scale::Log => parameter.lower * (parameter.upper / parameter.lower).powf(share),
            };
        }
    }
    starts
}

/// The parameters in which starts differ from `base`.
pub(crate) fn differing(starts: &[Start], base: &[f64]) -> Vec<usize> {
    (0..base.len()).filter(|&j| starts.iter().any(|s| s.values[j] != base[j])).collect()
}

/// Sets the effects of `starts` to the strength at which they vanish, as nearly as their bounds allow.
pub(crate) fn vanish(values: &mut [f64], starts: &[Start], model: &Model) {
    for j in starts.iter().flat_map(|s| s.effect.clone()) {
        let parameter = &model.shared[j];
        if let Some(gone) = parameter.vanishes_at {
            values[j] = gone.clamp(parameter.lower, parameter.upper);
        }
    }
}

/// Starts from a smaller fitted model. Shared parameters keep their values. A new effect is tried weak, at its own
/// start and at each of its other starts, and almost absent, so that a richer model never fits worse.
pub(crate) fn starts_from(model: &Model, small: &Model, state: &Estimate, base: &[f64]) -> Vec<Vec<f64>> {
    let (shared, small_shared) = (model.shared.len(), small.shared.len());
    let grown = |mut start: Vec<f64>, gone: bool| {
        for (value, parameter) in start[..shared].iter_mut().zip(&model.shared) {
            match small.shared.iter().position(|p| p.name == parameter.name) {
                Some(i) => *value = state.values[i],
                None => match parameter.vanishes_at {
                    Some(at) if gone => *value = at.clamp(parameter.lower, parameter.upper),
                    Some(0.0) => *value *= 0.2,
                    _ => {}
                },
            }
        }
        start[shared..].copy_from_slice(&state.values[small_shared..]);
        start
    };
    let mut starts: Vec<Vec<f64>> = Vec::new();
    for start in starts_of(model, base).into_iter().map(|s| grown(s.values, false)).chain([grown(base.to_vec(), true)])
    {
        // Other starts of an effect that the smaller model has, too, lead to the same values.
        if !starts.contains(&start) {
            starts.push(start);
        }
    }
    starts
}

#[cfg(test)]
mod tests {
    use crate::fit::problem::test_record::record;
    use crate::fit::search::calibrate::calibrate;
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;

    const RIG: &str = r#"
name = "one pipe"
[fluid]
name = "water"
temperature_degC = 20.0
[[pipe]]
name = "main"
length_m = 80.0
inner_diameter_mm = 30.0
wall_thickness_mm = 2.0
material = "copper"
[upstream]
kind = "reservoir"
[downstream]
kind = "valve"
closing_time_s = 0.03
[[sensor]]
name = "P1"
kind = "pressure"
position_m = 80.0
unit = "kPa"
"#;

    const RUN: RunValues =
        RunValues { initial_velocity_m_s: 0.3, valve_head_m: 40.0, closing_time_s: 0.035, friction_scale: 1.1 };

    /// Effects that may be anywhere are found where they are, near either end and in between.
    #[test]
    #[ignore = "takes 14 s; CI runs it at night"]
    fn a_place_is_found_wherever_it_is() {
        let rig = Rig::from_toml(RIG, "rig.toml").unwrap();
        let cases: [(&str, &[&[f64]]); 4] = [
            ("leak", &[&[12.3, 0.6], &[40.0, 0.6], &[67.9, 0.6]]),
            ("blockage", &[&[9.1, 200.0], &[55.3, 200.0]]),
            ("section-change", &[&[8.7, 21.7, 1.15, 1.0], &[51.0, 73.0, 0.8, 1.0]]),
            ("side-branch", &[&[14.9, 3.1, 1.0], &[60.7, 7.7, 0.6]]),
        ];
        for (effect, truths) in cases {
            for truth in truths {
                let effects = parse_list(effect).unwrap();
                let runs = [record(&rig, &effects, &[&[1290.0], *truth].concat(), RUN, 0.1, 4.0)];
                let fit = calibrate(&rig, &runs, &effects, &Options::default(), &|_| {}).unwrap();
                let run = &fit.runs[0];
                assert!(run.rmse_m < 1.1 * run.noise_m, "{effect} {truth:?}: {} m", run.rmse_m);
                for (found, exact) in fit.parameters[1..].iter().zip(*truth) {
                    let off = (found.value - exact).abs();
                    let grid = 0.003 * if found.unit == "m" { 80.0 } else { *exact };
                    assert!(
                        off < 4.0 * found.standard_error() + grid,
                        "{effect} {truth:?}: {} {}",
                        found.name,
                        found.value
                    );
                }
            }
        }
    }
}
