//! A diagnosis that goes on: what is missing is added, what is no longer needed goes, until nothing is missing or no
//! effect explains the rest.

use crate::diagnose::Diagnosis;
use crate::diagnose::growing::{self, Growing};
use crate::fit::outcome::fit::Fit;
use crate::fit::search::options::Options;
use crate::model::effects::Chosen;
use crate::study::Study;
use crate::study::calibrate::Effects;
use crate::study::error::Result;

/// Most models that follow the first one.
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
///         Step::Diagnosed => println!("{:?}", search.diagnoses().last().map(|d| d.verdict)),
///         Step::TakenOut(effects) => println!("{} effects are no longer needed", effects.len()),
///     }
/// }
/// for fit in search.models() {
///     println!("{:?}: {:.3} m", fit.labels(), fit.pooled().0);
/// }
/// # Ok::<(), surgescope::Error>(())
/// ```
pub struct UntilDone {
    options: Options,
    start: Vec<Chosen>,
    /// The effects that the first model has.
    effects: Vec<Chosen>,
    search: Option<Growing>,
    models: Vec<Fit>,
    diagnoses: Vec<Diagnosis>,
}

/// What a step did.
#[derive(Debug)]
pub enum Step {
    /// The current model was diagnosed: see [`UntilDone::diagnoses`].
    Diagnosed,
    /// The current model did not need these effects, which were taken out.
    TakenOut(Vec<Chosen>),
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

    /// From the model with `effects`, which grew out of one with those of `start`: what was added to that one has to
    /// hold its own like what is added now.
    pub fn grown_from(start: Vec<Chosen>, effects: Vec<Chosen>, options: Options) -> UntilDone {
        UntilDone { options, start, effects, search: None, models: Vec::new(), diagnoses: Vec::new() }
    }

    /// The models, from the first one on.
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

    /// Diagnoses the current model and adds what is missing, or takes out what it does not need; none when it is done.
    ///
    /// # Errors
    /// As [`Study::diagnose_model`].
    pub fn step(&mut self, study: &Study) -> Result<Option<Step>> {
        let worse = self.diagnoses.last().is_some_and(Diagnosis::predicts_worse);
        if worse || self.is_cut_short() {
            return Ok(None);
        }
        if self.search.is_none() {
            self.search = Some(study.growing(&self.start, &self.effects, &self.options)?);
        }
        let Some(search) = &mut self.search else { return Ok(None) };
        let step = study.grow_on(search)?;
        Ok(step.map(|step| match step {
            growing::Step::Diagnosed(found) => {
                if self.models.is_empty() {
                    self.models.push(found.start.clone());
                }
                self.models.extend(found.answer().cloned());
                self.diagnoses.push(*found);
                Step::Diagnosed
            }
            growing::Step::TakenOut(fit, gone) => {
                self.models.push(*fit);
                Step::TakenOut(gone)
            }
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::Verdict;
    use crate::model::effects::parse_list;

    fn file(name: &str) -> std::path::PathBuf {
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings").join(name)
    }

    /// Creep is missing, and the start model has a leak that nothing shows: one is added, the other goes, and then
    /// nothing is missing.
    #[test]
    fn what_is_missing_is_added_and_what_is_not_needed_goes() {
        let study = Study::open([file("hdpe-creep.mcap")]).unwrap();
        let options = Options { most_reaches: 32, ..Options::default() };
        let start = parse_list("none").unwrap();
        let effects = parse_list("valve-seat-leak").unwrap();
        let mut search = UntilDone::grown_from(start, effects, options);
        let mut gone = Vec::new();
        while let Some(step) = search.step(&study).unwrap() {
            if let Step::TakenOut(effects) = step {
                gone.extend(effects.iter().map(Chosen::label));
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
