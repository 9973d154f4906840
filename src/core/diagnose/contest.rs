//! Rivals are compared at their optima and on as fine a grid, or not at all.

use rayon::prelude::*;

use crate::diagnose::baseline::Baseline;
use crate::diagnose::candidate::base_name;
use crate::diagnose::candidate_fit::{CandidateFit, FullFitter, best_forms, square, square_at_optimum};
use crate::diagnose::limits::{CONVERGE_BELOW, FULL_FITS, NO_FULL_FIT_ABOVE};
use crate::diagnose::screening::screened;
use crate::fit::outcome::fit::Fit;
use crate::fit::search::calibrate::coarse_on;
use crate::fit::search::starts::may_be_anywhere;

/// Compares the rivals at their optima: the best is fitted until it converges, the others also start from where it ended,
/// and none stays on a grid so coarse that its error might decide.
pub(crate) fn contest(fitter: &FullFitter, candidate_fits: &mut [CandidateFit]) {
    let fitted = candidate_fits.iter_mut().filter(|r| r.fit.is_some());
    let Some(best) = fitted.min_by(|a, b| a.square.total_cmp(&b.square)) else { return };
    best.converge(fitter);
    let Some(winner) = best.fit.clone() else { return };
    if is_located(&winner) {
        in_its_place(fitter, &winner, candidate_fits);
        elsewhere(fitter, &winner, candidate_fits);
    }
    let near = CONVERGE_BELOW * square(&winner);
    let rivals = candidate_fits.par_iter_mut().filter(|r| {
        let other = r.fit.as_ref().is_some_and(|f| f.effects.last() != winner.effects.last());
        other && r.square < near
    });
    rivals.for_each(|rival| {
        let fit = fitter.fit_from_rival(rival, &winner);
        rival.take(fit);
        let may_win = |f: &Fit| square_at_optimum(f) < square(&winner) || fitter.is_held_back(f);
        if rival.fit.as_ref().is_some_and(may_win) {
            rival.converge(fitter);
        }
    });
}

/// Tries the other effects where a located winner ended, in its place: it may imitate one whose own fits have missed the way. Fits those that
/// promise to leave about as little there as the winner.
fn in_its_place(fitter: &FullFitter, winner: &Fit, candidate_fits: &mut [CandidateFit]) {
    let last = winner.effects.len() - 1;
    let Ok(baseline) = Baseline::without(fitter.rig, fitter.runs, winner, last, fitter.options) else { return };
    let screened = screened(&baseline, fitter.progress);
    let name = base_name(winner.effects[last].effect.name());
    let (own, mut others): (Vec<_>, Vec<_>) =
        best_forms(&screened, |r| -r.square).into_iter().map(|(_, r)| r).partition(|r| r.form.effect == name);
    let Some(own) = own.first() else { return };
    others.retain(|r| r.square < NO_FULL_FIT_ABOVE * own.square);
    others.sort_by(|a, b| a.square.total_cmp(&b.square));
    others.truncate(FULL_FITS);
    candidate_fits.par_iter_mut().for_each(|candidate_fit| {
        if let Some(refit) = others.iter().find(|r| r.form.effect == candidate_fit.refit.form.effect) {
            candidate_fit.take(fitter.fit_from_refit(refit));
        }
    });
}

/// Looks along the whole pipe for every effect that may be anywhere, with everything else free. A refit begins where a linear forecast promises most, and
/// the forecast fails where the rest of the model has made up for the effect. Fits each that leaves about as little as the winner on the coarse grid,
/// and whose own fit leaves more.
fn elsewhere(fitter: &FullFitter, winner: &Fit, candidate_fits: &mut [CandidateFit]) {
    let near = CONVERGE_BELOW * square(winner);
    let leaves_more = |r: &CandidateFit| r.fit.is_none() || r.square >= near;
    let Ok(own) = coarse_on(fitter.rig, fitter.runs, &winner.effects, &winner.values(), fitter.options) else { return };
    candidate_fits.par_iter_mut().filter(|r| may_be_anywhere(&r.refit.form.chosen) && leaves_more(r)).for_each(
        |rival| {
            let found = fitter.relocated(rival, winner).ok();
            if let Some(found) = found.filter(|found| found.mean_square < CONVERGE_BELOW * own.mean_square) {
                rival.take(fitter.fit_from_values(rival.refit, &found.effects, &found.values));
            }
        },
    );
}

/// Whether the effect that the start model lacks may be anywhere along the pipe.
fn is_located(fit: &Fit) -> bool {
    fit.effects.last().is_some_and(may_be_anywhere)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::candidate::candidates;
    use crate::diagnose::candidate_fit::{least_fall, over_noise};
    use crate::diagnose::refit::{Refit, screen};
    use crate::fit::data::run_data::RunData;
    use crate::fit::problem::test_record::{HDPE, record, short_branch};
    use crate::fit::search::calibrate::{calibrate, refine};
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::model::effects::{Chosen, parse_list};
    use crate::rig::Rig;

    fn fitter<'a>(rig: &'a Rig, runs: &'a [RunData], effects: &'a [Chosen], options: &'a Options) -> FullFitter<'a> {
        FullFitter { rig, runs, effects, options, progress: &|_| {}, least_fall: least_fall(runs, 0.0) }
    }

    /// These effects, screened.
    fn screened_of(baseline: &Baseline, names: [&str; 2]) -> [Refit; 2] {
        let forms = candidates(baseline.rig, &baseline.effects, baseline.runs.len());
        names.map(|name| screen(baseline, forms.iter().find(|form| form.effect == name).unwrap()).unwrap())
    }

    /// A leak that was driven to the valve imitates a valve that does not close. That one has no fit of its own, and is found all the same.
    #[test]
    fn a_leak_at_the_valve_meets_the_leaking_seat() {
        let rig = Rig::from_toml(&HDPE.replace("HDPE", "copper"), "rig.toml").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.5, valve_head_m: 40.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let runs = [record(&rig, &parse_list("valve-seat-leak").unwrap(), &[1200.0, 3.0], run, 0.02, 3.0)];
        let options = Options { most_reaches: 128, ..Options::default() };
        let start = calibrate(&rig, &runs, &[], &options, &|_| {}).unwrap();
        let baseline = Baseline::new(&rig, &runs, &start, &options).unwrap();
        let screened = screened_of(&baseline, ["leak", "valve-seat-leak"]);
        let mut fits = screened.each_ref().map(|refit| CandidateFit::forecast(&baseline, &start, refit, 0.0));
        let (leak, seat) = (0, 1);
        let effects = parse_list("leak").unwrap();
        let mut values = start.values();
        values.splice(1..1, [0.98 * rig.length_m(), 3.0]);
        fits[leak].take(refine(&rig, &runs, &effects, &values, &options, &|_| {}));
        let fitter = fitter(&rig, &runs, &[], &options);
        contest(&fitter, &mut fits);
        let imitation = fits[leak].fit.as_ref().unwrap();
        assert!(is_located(imitation) && imitation.parameter("leak_position_m").unwrap().at_bound);
        let found = fits[seat].fit.as_ref().unwrap();
        assert!(over_noise(found, &runs) < 1.05 && square(found) < square(fits[leak].fit.as_ref().unwrap()));
        let area_mm2 = found.parameter("seat_cda_mm2").unwrap().value;
        assert!((area_mm2 - 3.0).abs() < 0.1, "{area_mm2}");
        // no leak is believed to be just where its place ends
        let [leak, seat] = fits.each_ref().map(|candidate| candidate.odds(&baseline));
        assert!(leak < 0.1 * seat, "{leak} {seat}");
    }

    /// Near the noise a fit with gas, whose grid was kept coarse, goes on to a finer one, though it has converged; one without cavities has had it.
    #[test]
    fn gas_meets_its_rivals_on_a_fine_grid() {
        let rig = Rig::from_toml(&HDPE.replace("HDPE", "copper"), "rig.toml").unwrap();
        let run =
            RunValues { initial_velocity_m_s: 0.3, valve_head_m: 40.0, closing_time_s: 0.05, friction_scale: 1.0 };
        let runs = [record(&rig, &parse_list("entrained-gas").unwrap(), &[1200.0, 2e-6, 1e-5], run, 0.2, 2.0)];
        let options = Options { most_reaches: 256, grid_error_over_noise: 0.0, ..Options::default() };
        let coarse = Options { most_reaches: 64, ..Options::default() };
        let start = calibrate(&rig, &runs, &[], &coarse, &|_| {}).unwrap();
        let baseline = Baseline::new(&rig, &runs, &start, &options).unwrap();
        let fitter = fitter(&rig, &runs, &[], &options);
        let screened = screened_of(&baseline, ["entrained-gas", "valve-seat-leak"]);
        for (refit, finer) in screened.iter().zip([true, false]) {
            let name = refit.form.effect;
            let mut candidate = CandidateFit::forecast(&baseline, &start, refit, 0.0);
            candidate.take(calibrate(&rig, &runs, &parse_list(name).unwrap(), &coarse, &|_| {}));
            let begun = candidate.fit.clone().unwrap();
            assert!(begun.converged && begun.reaches < 200 && over_noise(&begun, &runs) < 2.0, "{name}");
            candidate.converge(&fitter);
            let reaches = candidate.fit.as_ref().unwrap().reaches;
            assert_eq!(reaches > begun.reaches, finer, "{name}: {reaches}");
        }
    }

    /// In a pipe that creeps a change of section imitates a short branch, whose refit cannot leave the place where the creep has made up for it.
    #[test]
    fn a_change_of_section_meets_the_branch_wherever_that_is() {
        let (rig, record) = short_branch();
        let runs = [record];
        let options = Options { most_reaches: 128, ..Options::default() };
        let effects = parse_list("viscoelastic-wall:2").unwrap();
        let start = calibrate(&rig, &runs, &effects, &options, &|_| {}).unwrap();
        let baseline = Baseline::new(&rig, &runs, &start, &options).unwrap();
        let screened = screened_of(&baseline, ["section-change", "side-branch"]);
        let mut fits = screened.each_ref().map(|refit| CandidateFit::forecast(&baseline, &start, refit, 0.0));
        let (section, branch) = (0, 1);
        let fitter = fitter(&rig, &runs, &effects, &options);
        let fit = fitter.fit_from_refit(fits[section].refit);
        fits[section].take(fit);
        contest(&fitter, &mut fits);
        let found = fits[branch].fit.as_ref().unwrap();
        assert!(square(found) < square(fits[section].fit.as_ref().unwrap()) && over_noise(found, &runs) < 1.05);
        let place_m = found.parameter("branch_position_m").unwrap().value;
        assert!((place_m - 89.9).abs() < 0.5, "{place_m}");
    }
}
