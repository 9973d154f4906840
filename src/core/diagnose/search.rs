//! The search: models with more effects than the start model, the most promising first.
//!
//! A state is a set of effects that the start model lacks. The search is one loop. It grows models: the projected
//! residual on the coarse grid forecasts what each further effect would leave
//! ([`screening`](crate::diagnose::screening)), and those that may win are fitted from there, later also from the
//! signals. And it compares the best model with its rivals ([`rivals`](crate::diagnose::rivals)), by exchanging effects
//! and leaving them out, until all that may be claimed is at its optimum. It ends where neither is left to do.

use crate::diagnose::evidence::tempered;
use crate::diagnose::measures::{beyond, fall, square};
use crate::diagnose::met::{Done, Key, Met, Starts};
use crate::diagnose::models::Search;
use crate::diagnose::weigh::{WeighedModel, weigh};
use crate::fit::outcome::fit::Fit;
use crate::fit::outcome::thresholds::STRONG_EVIDENCE;
use crate::fit::search::thresholds::{DOUBTFUL_ABOVE, NOISE_LIKE};

impl Search<'_> {
    /// Looks for models with as many effects more as `most` than those of a `state`, which is grown whatever it leaves.
    /// Models near the noise are compared as soon as they are met, others at the end.
    pub(crate) fn run(&mut self, state: &Key, most: usize) {
        loop {
            let step = self.next(state, state.len() + most);
            let comparison = if step.is_none() || self.is_near() { self.comparison() } else { None };
            match (comparison, step) {
                (Some(comparison), _) => self.compare(comparison),
                (None, Some((state, starts))) => {
                    self.done.push((state.clone(), starts, square(self.begun_at(&state))));
                    self.step(&state, starts);
                }
                (None, None) => break,
            }
        }
        // what keeps elements of creep from their optimum does not decide which model is better
        let Some(best) = self.claim().filter(|met| !met.is_pruned).map(|met| met.key.clone()) else { return };
        let place = self.place(&best);
        if let Some(pruned) = self.met[place].fit.as_ref().and_then(|fit| self.fitter.pruned(fit)) {
            self.met[place].fit = Some(pruned);
        }
        self.met[place].is_pruned = true;
    }

    /// Where the search goes on from a state.
    fn begun_at(&self, state: &Key) -> &Fit {
        self.get(state).and_then(|m| m.fit.as_ref()).unwrap_or(self.from)
    }

    /// The next step: small models before big ones, cheap starts before dear ones. The search goes on from the best
    /// model of each size, and from those that the records cannot tell from it, where they are better than the start
    /// model. One that a record shows by itself leaves no second effect, for no model follows the collapse of cavities
    /// well.
    fn next(&self, state: &Key, most: usize) -> Option<(Key, Starts)> {
        let weighed = weigh(self, &Key::new());
        let of_size = |size| weighed.models.iter().filter(move |m| m.added.len() == size && m.met.fit.is_some());
        let bigger = (1..most).filter_map(|size| {
            let best = of_size(size).next()?;
            // A parameter at a bound says little as long as another effect is missing.
            let alike = |m: &&WeighedModel| tempered(best.evidence - m.evidence) < STRONG_EVIDENCE;
            let open = of_size(size).filter(alike).filter(|m| {
                m.evidence > 0.0 && !m.is_shown && m.met.fit.as_ref().is_some_and(|fit| self.leaves_room(fit))
            });
            Some(open.map(|m| m.met.key.clone()).collect::<Vec<Key>>()).filter(|open| !open.is_empty())
        });
        let states: Vec<Vec<Key>> = [vec![Key::new()], vec![state.clone()]].into_iter().chain(bigger).collect();
        let dear = |state: &Key, starts| starts != Starts::Forecast && self.is_quiet(state.len() + 1);
        let near = states.iter().flatten().flat_map(|s| [(s, Starts::Forecast), (s, Starts::LeadingFromSignals)]);
        let far = states.iter().filter_map(|alike| Some((alike.first()?, Starts::AllFromSignals)));
        let mut steps = near.chain(far);
        // a state that has come to leave much less since is forecast again
        let as_before = |state: &Key, left: f64| fall(self.start, left, square(self.begun_at(state))) < self.least_fall;
        let is_done = |state: &Key, starts: Starts| {
            let same = |d: &&Done| d.0 == *state && d.1 == starts;
            self.done.iter().filter(same).any(|d| starts != Starts::Forecast || as_before(state, d.2))
        };
        let step = steps.find(|(state, starts)| !is_done(state, *starts) && !dear(state, *starts))?;
        Some((step.0.clone(), step.1))
    }

    /// Whether a model leaves so much that a further effect could be worth it.
    pub(crate) fn leaves_room(&self, fit: &Fit) -> bool {
        beyond(fit, self.fitter.runs) >= self.least_fall_after(self.taken(fit))
    }

    /// Whether a model of at most that size leaves so little that forecasts are accurate: what they do not promise will
    /// not appear.
    pub(crate) fn is_quiet(&self, size: usize) -> bool {
        let fits = self.met.iter().filter(|m| m.key.len() <= size).filter_map(|m| m.fit.as_ref());
        fits.chain([self.start]).any(|fit| fit.over_noise() < NOISE_LIKE)
    }

    fn step(&mut self, state: &Key, starts: Starts) {
        match starts {
            Starts::Forecast => {
                let fit = self.begun_at(state).clone();
                let forecast = self.expand(&fit, None);
                self.fit_leading(&forecast, square(&fit));
                if state.is_empty() {
                    self.more_elements();
                    self.shown_by_itself();
                }
            }
            Starts::LeadingFromSignals => self.leading_from_signals(state.len() + 1),
            Starts::AllFromSignals => {
                self.all_from_signals(state);
                self.leading_from_signals(state.len() + 1);
            }
        }
    }

    /// The most probable of the fitted models.
    pub(crate) fn leader(&self) -> Option<&Met> {
        weigh(self, &Key::new()).models.into_iter().map(|m| m.met).find(|m| m.fit.is_some())
    }

    /// The most probable of the fitted models whose evidence is enough.
    pub(crate) fn claim(&self) -> Option<&Met> {
        weigh(self, &Key::new()).claim().map(|m| m.met)
    }

    /// Whether the best model is near enough for its rivals to be compared with it.
    fn is_near(&self) -> bool {
        let near = DOUBTFUL_ABOVE.powi(2) - 1.0;
        self.leader().and_then(|m| m.fit.as_ref()).is_some_and(|fit| beyond(fit, self.fitter.runs) < near)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::diagnose::baseline::Baseline;
    use crate::fit::data::run_data::RunData;
    use crate::fit::problem::test_record::{copper, record, short_branch};
    use crate::fit::search::calibrate::{Fitter, calibrate};
    use crate::fit::search::options::Options;
    use crate::model::RunValues;
    use crate::model::effects::parse_list;
    use crate::rig::Rig;

    /// What `check` finds in a search from a model with these effects.
    pub(crate) fn searched(rig: &Rig, runs: &[RunData], effects: &str, options: &Options, check: impl Fn(&mut Search)) {
        let asked = parse_list(effects).unwrap();
        let start = calibrate(rig, runs, &asked, options, &|_| {}).unwrap();
        let baseline = Baseline::new(rig, runs, &start, options).unwrap();
        let fitter = Fitter::new(rig, runs, options, &|_| {});
        check(&mut Search::new(fitter, &asked, &start, &start, &baseline));
    }

    pub(crate) fn run(initial_velocity_m_s: f64) -> RunValues {
        RunValues { initial_velocity_m_s, valve_head_m: 40.0, closing_time_s: 0.05, friction_scale: 1.0 }
    }

    /// In a pipe that creeps a change of section imitates a short branch, whose forecast cannot leave the place where
    /// the creep has made up for it.
    #[test]
    fn a_short_branch_is_found_where_a_change_of_section_imitates_it() {
        let (rig, record) = short_branch();
        let (runs, options) = ([record], Options { most_reaches: 128, ..Options::default() });
        searched(&rig, &runs, "viscoelastic-wall:2", &options, |search| {
            search.run(&Key::new(), 1);
            let best = search.leader().unwrap();
            assert_eq!(best.key, ["side-branch"]);
            let place_m = best.fit.as_ref().unwrap().parameter("branch_position_m").unwrap().value;
            assert!((place_m - 89.9).abs() < 0.5, "{place_m}");
        });
    }

    /// A model with an effect more starts where the smaller one ended, so it leaves no more.
    #[test]
    fn a_bigger_model_leaves_no_more() {
        let rig = copper();
        let truth = parse_list("leak,valve-seat-leak").unwrap();
        let runs = [record(&rig, &truth, &[1200.0, 12.0, 4.0, 3.0], run(0.5), 0.02, 3.0)];
        let options = Options { most_reaches: 64, ..Options::default() };
        searched(&rig, &runs, "none", &options, |search| {
            search.run(&Key::new(), 2);
            let fitted: Vec<&Met> = search.met.iter().filter(|m| m.fit.is_some()).collect();
            let best = search.leader().unwrap();
            assert_eq!(best.key, ["leak", "valve-seat-leak"]);
            for smaller in fitted.iter().filter(|m| m.key.iter().all(|name| best.key.contains(name))) {
                assert!(best.square() <= smaller.square(), "{:?} {:?}", best.key, smaller.key);
            }
        });
    }
}
