//! Rivals: nothing is claimed as long as a model that may be more probable is not at its optimum.

use rayon::prelude::*;

use crate::diagnose::limits::PRIOR_ODDS_OF_NOTHING;
use crate::diagnose::measures::square;
use crate::diagnose::met::Met;
use crate::diagnose::models::Search;
use crate::diagnose::weigh::weigh;
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::search::options::Effort;
use crate::model::effects::Chosen;

/// What is to be done before the best model is claimed.
pub(crate) enum Comparison {
    /// The forecasts of these models promise as much: they are fitted.
    Begin(Vec<usize>),
    /// These models are fitted on to their optima.
    Settle(Vec<usize>),
    /// Other effects are tried in the place of each one of the best model, and it is fitted without each.
    LookAround(usize),
}

impl Search<'_> {
    /// The next comparison: of the best model, then of its rivals within reach. None where all that may be claimed is
    /// at its optimum.
    pub(crate) fn comparison(&self) -> Option<Comparison> {
        let weighed = weigh(self, &[]);
        let place = |met: &Met| self.met.iter().position(|m| m.key == met.key).unwrap_or_default();
        let nothing = PRIOR_ODDS_OF_NOTHING.ln();
        let best = weighed.models.iter().find(|m| m.met.fit.is_some()).filter(|m| m.log_odds() > nothing);
        if let Some(best) = best {
            if !best.met.is_at_end {
                return Some(Comparison::Settle(vec![place(best.met)]));
            }
            if best.met.looked_around != Some(best.met.square()) {
                return Some(Comparison::LookAround(place(best.met)));
            }
        }
        let claimed = best.map_or(nothing, |best| best.log_odds());
        let within_reach = weighed.models.iter().filter(|m| m.promised_log_odds > claimed - STRONG_EVIDENCE);
        let (begun, new): (Vec<&Met>, Vec<&Met>) = within_reach.map(|m| m.met).partition(|m| m.fit.is_some());
        let unsettled: Vec<usize> = begun.into_iter().filter(|m| !m.is_at_end).map(place).collect();
        match (new.is_empty(), unsettled.is_empty()) {
            (false, _) => Some(Comparison::Begin(new.into_iter().map(place).collect())),
            (true, false) => Some(Comparison::Settle(unsettled)),
            (true, true) => None,
        }
    }

    pub(crate) fn compare(&mut self, comparison: Comparison) {
        match comparison {
            Comparison::Begin(which) => self.fit_forecasts(&which),
            Comparison::Settle(which) => self.settle(&which),
            Comparison::LookAround(best) => self.look_around(best),
        }
    }

    /// Leads models on to their optima. Elements of creep whose number is open grow, those of the start model only
    /// where room is left: a further effect would make up for missing ones.
    pub(crate) fn settle(&mut self, which: &[usize]) {
        let this = &*self;
        let ends: Vec<(usize, Option<Fit>)> = which
            .par_iter()
            .map(|&i| {
                let end = this.met[i].fit.as_ref().and_then(|fit| this.at_its_end(fit));
                (i, end)
            })
            .collect();
        for (i, end) in ends {
            self.met[i].fit = end.or(self.met[i].fit.take());
            self.met[i].is_at_end = true;
        }
    }

    fn at_its_end(&self, fit: &Fit) -> Option<Fit> {
        let end = self.fitter.to_its_end(fit).ok()?;
        Some(self.open(fit).and_then(|i| self.with_more_elements(&end, i)).unwrap_or(end))
    }

    /// The effect of a model whose elements may grow.
    fn open(&self, fit: &Fit) -> Option<usize> {
        let (added, room) = (self.added(&fit.effects), self.leaves_room(fit));
        let is_fixed =
            |c: &Chosen| self.asked.iter().any(|a| a.elements.is_some() && a.effect.name() == c.effect.name());
        (0..fit.effects.len()).find(|i| {
            let c = &fit.effects[*i];
            c.elements.is_some() && !is_fixed(c) && (room || added.contains(i))
        })
    }

    /// Tries the other effects in the place of each one that the best model adds: beside the rest as it stands now they
    /// may be far better than they were beside the start model, where one may have imitated another.
    fn look_around(&mut self, best: usize) {
        let Some(winner) = self.met[best].fit.clone() else { return };
        self.met[best].looked_around = Some(square(&winner));
        for i in self.added(&winner.effects) {
            let forecast = self.expand(&winner, Some(i));
            self.fit_leading(&forecast, square(self.start));
        }
        self.without_one(&winner);
    }

    /// The model without each of its added effects, from where the rest stands: beside the other one an effect may have
    /// got where it explains the records alone.
    fn without_one(&mut self, winner: &Fit) {
        let added = self.added(&winner.effects);
        if added.len() < 2 {
            return;
        }
        let fitter = &self.fitter;
        let fits: Vec<Fit> = added.par_iter().filter_map(|&i| fitter.without(winner, i, Effort::Brief).ok()).collect();
        fits.into_iter().for_each(|fit| self.take(fit));
    }
}

#[cfg(test)]
mod tests {
    use crate::diagnose::search::tests::{run, searched};
    use crate::fit::problem::test_record::{copper, record};
    use crate::fit::search::calibrate::{calibrate, refine};
    use crate::fit::search::options::Options;
    use crate::model::effects::parse_list;

    /// A leak that was driven to the valve imitates a valve that does not close. That one has no fit of its own, and is
    /// found all the same.
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
            search.take(leak);
            while let Some(comparison) = search.comparison() {
                search.compare(comparison);
            }
            let [leak, seat] = ["leak", "valve-seat-leak"].map(|name| search.get(&[name]).unwrap());
            let found = seat.fit.as_ref().unwrap();
            assert!(found.over_noise() < 1.05 && seat.square() < leak.square());
            let area_mm2 = found.parameter("seat_cda_mm2").unwrap().value;
            assert!((area_mm2 - 3.0).abs() < 0.1, "{area_mm2}");
        });
    }

    /// Near the noise a fit with gas, whose grid was kept coarse, goes on to a finer one, though it has converged; one
    /// without cavities has had it.
    #[test]
    fn gas_meets_its_rivals_on_a_fine_grid() {
        let rig = copper();
        let runs = [record(&rig, &parse_list("entrained-gas").unwrap(), &[1200.0, 2e-6, 1e-5], run(0.3), 0.2, 2.0)];
        let options = Options { most_reaches: 256, grid_error_over_noise: 0.0, ..Options::default() };
        let coarse = Options { most_reaches: 64, ..Options::default() };
        searched(&rig, &runs, "none", &options, |search| {
            for (name, finer) in [("entrained-gas", true), ("valve-seat-leak", false)] {
                let begun = calibrate(&rig, &runs, &parse_list(name).unwrap(), &coarse, &|_| {}).unwrap();
                assert!(begun.converged && begun.reaches < 200 && begun.over_noise() < 2.0, "{name}");
                let from = begun.reaches;
                search.take(begun);
                let place = search.place(&[name]);
                search.settle(&[place]);
                let reaches = search.get(&[name]).unwrap().fit.as_ref().unwrap().reaches;
                assert_eq!(reaches > from, finer, "{name}: {reaches}");
            }
        });
    }
}
