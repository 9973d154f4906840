//! Rivals: models of one size that come near the best one are fitted on before they are compared with it.

use rayon::prelude::*;

use crate::diagnose::limits::CONVERGE_BELOW;
use crate::diagnose::measures::{square, square_at_optimum};
use crate::diagnose::met::Key;
use crate::diagnose::models::Search;
use crate::fit::outcome::fit::Fit;
use crate::model::Model;
use crate::model::effects::Chosen;

impl Search<'_> {
    /// Compares rivals at their optima: the best model is fitted until it converges, the other effects are tried in the place of each of its own, and
    /// whoever comes near it is fitted on from where it ended.
    pub(crate) fn contest(&mut self) {
        loop {
            let Some(best) = self.leader().map(|m| m.key.clone()) else { return };
            self.converge(&best);
            let met = self.get_mut(&best);
            if std::mem::replace(&mut met.is_contested, true) {
                return;
            }
            let Some(winner) = met.fit.clone() else { return };
            for i in self.added(&winner.effects) {
                // One that may be anywhere imitates others; one that leaves much may stand in for another.
                if winner.effects[i].effect.on_pipe() || !self.is_quiet(best.len()) {
                    self.expand(&winner, Some(i));
                    self.fit_leading(best.len());
                }
            }
            self.rivals(&winner, &best);
            self.without_one(&winner);
            if self.leader().is_some_and(|m| m.key == best) {
                return;
            }
        }
    }

    /// Fits on the rivals of a model from where that ended, and until they converge where they may leave less.
    fn rivals(&mut self, winner: &Fit, own: &Key) {
        let near = CONVERGE_BELOW * square(winner);
        let rivals: Vec<usize> = (0..self.met.len())
            .filter(|&i| self.met[i].key != *own && self.met[i].key.len() == own.len() && self.met[i].fit.is_some())
            .filter(|&i| self.met[i].square() < near && !self.met[i].is_converged)
            .collect();
        let this = &*self;
        let fits: Vec<(usize, Vec<Fit>)> = rivals
            .par_iter()
            .map(|&i| {
                let mut fits = Vec::new();
                let Some((effects, values)) = this.met[i].model() else { return (i, fits) };
                let moved = this.transplanted(winner, effects, &values);
                fits.extend(this.fitter.on_from(effects, &moved).ok());
                let better =
                    fits.first().filter(|f| square(f) < this.met[i].square()).or(this.met[i].fit.as_ref()).cloned();
                if let Some(better) = better {
                    let may_win = square_at_optimum(&better) < square(winner) || this.fitter.is_held_back(&better);
                    if may_win && (!better.converged || this.fitter.is_held_back(&better)) {
                        fits.extend(this.fitter.converged(&better).ok());
                    }
                }
                (i, fits)
            })
            .collect();
        for (i, fits) in fits {
            for fit in fits {
                self.met[i].take(fit);
            }
            self.met[i].is_converged = true;
        }
    }

    /// The model without each of its added effects, from where the rest stands: beside the other one an effect may have got where it explains the
    /// records alone.
    fn without_one(&mut self, winner: &Fit) {
        let added = self.added(&winner.effects);
        if added.len() < 2 {
            return;
        }
        let fitter = &self.fitter;
        let fits: Vec<Fit> = added.par_iter().filter_map(|&i| fitter.without(winner, i).ok()).collect();
        for fit in fits {
            let key = self.key(&fit.effects);
            self.get_mut(&key).take(fit);
        }
    }

    /// Values of a model with `effects`: those of the winner where it has the same effect, else its own.
    fn transplanted(&self, winner: &Fit, effects: &[Chosen], own: &[f64]) -> Vec<f64> {
        let water = &self.fitter.runs[0].conditions.water;
        let of = |effects: &[Chosen]| Model::new(self.fitter.rig, water, effects);
        let (ours, theirs, from) = (of(effects), of(&winner.effects), winner.values());
        let mut values: Vec<f64> = from[..theirs.effects_from()].to_vec();
        for (i, c) in effects.iter().enumerate() {
            let same = winner.effects.iter().position(|w| w == c);
            values.extend(match same {
                Some(k) => &from[theirs.parameters_of(k)],
                None => &own[ours.parameters_of(i)],
            });
        }
        values.extend(&from[theirs.shared.len()..]);
        values
    }

    /// Fits a model on until it converges, on as fine a grid as it takes.
    pub(crate) fn converge(&mut self, key: &Key) {
        let Some(met) = self.get(key) else { return };
        let Some(fit) = met.fit.as_ref().filter(|_| !met.is_converged) else { return };
        let at_end = fit.converged && !self.fitter.is_held_back(fit);
        let on = if at_end { None } else { self.fitter.converged(fit).ok() };
        let met = self.get_mut(key);
        if let Some(on) = on {
            met.take(on);
        }
        met.is_converged = true;
    }
}

#[cfg(test)]
mod tests {
    use crate::diagnose::measures::over_noise;
    use crate::diagnose::search::tests::{copper, run, searched};
    use crate::fit::problem::test_record::record;
    use crate::fit::search::calibrate::{calibrate, refine};
    use crate::fit::search::options::Options;
    use crate::model::effects::parse_list;

    /// A leak that was driven to the valve imitates a valve that does not close. That one has no fit of its own, and is found all the same.
    #[test]
    fn a_leak_at_the_valve_meets_the_leaking_seat() {
        let rig = copper();
        let runs = [record(&rig, &parse_list("valve-seat-leak").unwrap(), &[1200.0, 3.0], run(0.5), 0.02, 3.0)];
        let options = Options { most_reaches: 128, ..Options::default() };
        searched(&rig, &runs, "none", &options, |search| {
            let mut values = search.start.values();
            values.splice(1..1, [0.98 * rig.length_m(), 3.0]);
            let leak = refine(&rig, &runs, &parse_list("leak").unwrap(), &values, &options, &|_| {}).unwrap();
            assert!(leak.parameter("leak_position_m").unwrap().at_bound);
            search.get_mut(&["leak"]).take(leak);
            search.contest();
            let [leak, seat] = ["leak", "valve-seat-leak"].map(|name| search.get(&[name]).unwrap());
            let found = seat.fit.as_ref().unwrap();
            assert!(over_noise(found, &runs) < 1.05 && seat.square() < leak.square());
            let area_mm2 = found.parameter("seat_cda_mm2").unwrap().value;
            assert!((area_mm2 - 3.0).abs() < 0.1, "{area_mm2}");
        });
    }

    /// Near the noise a fit with gas, whose grid was kept coarse, goes on to a finer one, though it has converged; one without cavities has had it.
    #[test]
    fn gas_meets_its_rivals_on_a_fine_grid() {
        let rig = copper();
        let runs = [record(&rig, &parse_list("entrained-gas").unwrap(), &[1200.0, 2e-6, 1e-5], run(0.3), 0.2, 2.0)];
        let options = Options { most_reaches: 256, grid_error_over_noise: 0.0, ..Options::default() };
        let coarse = Options { most_reaches: 64, ..Options::default() };
        searched(&rig, &runs, "none", &options, |search| {
            for (name, finer) in [("entrained-gas", true), ("valve-seat-leak", false)] {
                let begun = calibrate(&rig, &runs, &parse_list(name).unwrap(), &coarse, &|_| {}).unwrap();
                assert!(begun.converged && begun.reaches < 200 && over_noise(&begun, &runs) < 2.0, "{name}");
                let from = begun.reaches;
                search.get_mut(&[name]).take(begun);
                search.converge(&vec![name]);
                let reaches = search.get(&[name]).unwrap().fit.as_ref().unwrap().reaches;
                assert_eq!(reaches > from, finer, "{name}: {reaches}");
            }
        });
    }
}
