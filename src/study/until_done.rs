//! The loop of a diagnosis: what is missing is added, what is no longer needed goes, until nothing is missing or no effect explains the rest.

use crate::diagnose::{Diagnosis, Verdict};
use crate::fit::outcome::fit::Fit;
use crate::fit::search::options::Options;
use crate::fit::search::sensor_choice::is_open;
use crate::model::effects::Chosen;
use crate::study::Study;
use crate::study::calibrate::Effects;
use crate::study::error::Result;

/// Most effects that are added one after the other.
const MOST_ADDED: usize = 8;

/// A diagnosis that goes on until it is done, one [`step`](UntilDone::step) after the other.
///
/// ```no_run
/// use surgescope::Study;
/// use surgescope::study::until_done::{Step, UntilDone};
///
/// let study = Study::open(["recordings/hdpe-creep.mcap"])?;
/// let mut search = UntilDone::starting("none")?;
/// while let Some(step) = search.step(&study)? {
///     match step {
///         Step::Diagnosed { .. } => println!("{:?}", search.diagnoses().last().map(|d| d.verdict)),
///         Step::TakenOut(effect) => println!("{} is no longer needed", effect.label()),
///     }
/// }
/// for fit in search.models() {
///     println!("{:?}: {:.3} m", fit.labels(), fit.pooled().0);
/// }
/// # Ok::<(), surgescope::Error>(())
/// ```
pub struct UntilDone {
    options: Options,
    /// The effects of the start model.
    start: Vec<Chosen>,
    /// The effects of the current model; those whose number of elements or sensor the user left open keep it open.
    effects: Vec<Chosen>,
    /// The effects of the start model and those found last, which were compared with their rivals beside all others.
    settled: Vec<Chosen>,
    models: Vec<Fit>,
    diagnoses: Vec<Diagnosis>,
    next: Next,
}

/// What comes next.
#[derive(Clone, Copy, PartialEq)]
enum Next {
    Diagnosis,
    /// To take out what is not needed; the model has `changed` since the last diagnosis.
    Needless {
        changed: bool,
    },
    Nothing,
}

/// What a step did.
#[derive(Debug)]
pub enum Step {
    /// The current model was diagnosed: see [`UntilDone::diagnoses`].
    Diagnosed {
        /// The effect of the model that stood in for what is missing, and was exchanged for it.
        exchanged: Option<Chosen>,
    },
    /// The current model no longer needed this effect, which was taken out.
    TakenOut(Chosen),
}

impl UntilDone {
    /// From the model with these effects, with the usual options.
    ///
    /// # Errors
    /// Effects that do not exist or exclude each other.
    pub fn starting(effects: impl Effects) -> Result<UntilDone> {
        let effects = effects.chosen()?;
        Ok(UntilDone::grown_from(effects.clone(), effects, Options::default()))
    }

    /// From the model with `effects`, which grew out of one with those of `start`: what was added to that one has to hold its own like what is
    /// added now.
    pub fn grown_from(start: Vec<Chosen>, effects: Vec<Chosen>, options: Options) -> UntilDone {
        let settled = start.clone();
        UntilDone { options, start, effects, settled, models: Vec::new(), diagnoses: Vec::new(), next: Next::Diagnosis }
    }

    /// The models, from the start model on.
    pub fn models(&self) -> &[Fit] {
        &self.models
    }

    /// The diagnoses so far. The last one is that of the last model, unless an effect was added or taken out since.
    pub fn diagnoses(&self) -> &[Diagnosis] {
        &self.diagnoses
    }

    /// Whether it stopped because too many effects were added, rather than because it was done.
    pub fn is_cut_short(&self) -> bool {
        self.models.len() > MOST_ADDED
    }

    /// Diagnoses the current model and adds what is missing, or takes out one effect that it does not need; none when it is done.
    ///
    /// # Errors
    /// As [`Study::diagnose_model`].
    pub fn step(&mut self, study: &Study) -> Result<Option<Step>> {
        if let (Next::Needless { changed }, Some(fit)) = (self.next, self.models.last()) {
            if let Some((smaller, gone)) = study.without_needless(fit, &self.settled, &self.options) {
                self.models.push(smaller);
                self.next = Next::Needless { changed: true };
                return Ok(Some(Step::TakenOut(gone)));
            }
            let worse = self.diagnoses.last().is_some_and(Diagnosis::predicts_worse);
            if !changed || worse || self.diagnoses.len() > MOST_ADDED {
                self.next = Next::Nothing;
            } else {
                self.effects = grown(&self.effects, &fit.effects);
                self.next = Next::Diagnosis;
            }
        }
        if self.next == Next::Nothing {
            return Ok(None);
        }
        self.diagnose(study).map(Some)
    }

    fn diagnose(&mut self, study: &Study) -> Result<Step> {
        let first = self.models.first();
        // what was added is fitted
        let mut found = match self.models.last() {
            Some(fit) => study.diagnose_next(fit.clone(), first, &self.effects, &self.options)?,
            None => study.diagnose_model(&self.effects, &self.options)?,
        };
        let mut exchanged = None;
        if let (None, Some(first), Some(fit)) = (found.answer(), first, self.models.last())
            && let Some((other, gone)) = study.exchanged(fit, &self.settled, first, &self.options)
        {
            self.diagnoses.push(std::mem::replace(&mut found, other));
            exchanged = Some(gone);
        }
        if self.models.is_empty() {
            self.models.push(found.start.clone());
        }
        let added = found.answer().cloned();
        // where nothing is missing at once, there may be too much
        let may_shrink = found.verdict == Verdict::NothingMissing && self.models.len() == 1;
        self.next = match added.is_some() || may_shrink {
            true => Next::Needless { changed: added.is_some() },
            false => Next::Nothing,
        };
        if let Some(fit) = added.as_ref().or(may_shrink.then_some(&found.start)) {
            // what was just added has its evidence
            let is_new = |c: &&Chosen| self.effects.iter().all(|known| known.effect.name() != c.effect.name());
            self.settled = self.start.iter().chain(fit.effects.iter().filter(is_new)).cloned().collect();
        }
        self.models.extend(added);
        self.diagnoses.push(found);
        Ok(Step::Diagnosed { exchanged })
    }
}

/// The effects of the next step: what was found is added, what had its number left open keeps it open.
fn grown(asked: &[Chosen], found: &[Chosen]) -> Vec<Chosen> {
    let open = |c: &Chosen| asked.iter().any(|a| a.effect.name() == c.effect.name() && is_open(a));
    found.iter().map(|c| if open(c) { Chosen { elements: None, ..c.clone() } } else { c.clone() }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::effects::parse_list;

    fn file(name: &str) -> std::path::PathBuf {
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings").join(name)
    }

    /// Creep is missing, and the start model has a leak that nothing shows: one is added, the other goes, and then nothing is missing.
    #[test]
    fn what_is_missing_is_added_and_what_is_not_needed_goes() {
        let study = Study::open([file("hdpe-creep.mcap")]).unwrap();
        let options = Options { most_reaches: 32, ..Options::default() };
        let start = parse_list("none").unwrap();
        let effects = parse_list("valve-seat-leak").unwrap();
        let mut search = UntilDone::grown_from(start, effects, options);
        let mut gone = Vec::new();
        while let Some(step) = search.step(&study).unwrap() {
            if let Step::TakenOut(effect) = step {
                gone.push(effect.label());
            }
        }
        let last = search.models().last().unwrap();
        assert!(last.labels().iter().any(|l| l.starts_with("viscoelastic-wall")), "{:?}", last.labels());
        assert!(!last.labels().contains(&"valve-seat-leak".to_owned()) && gone == ["valve-seat-leak"], "{gone:?}");
        assert_eq!(search.diagnoses().last().unwrap().verdict, Verdict::NothingMissing);
        assert!(!search.is_cut_short());
        assert!(search.step(&study).unwrap().is_none(), "it stays done");
    }
}
