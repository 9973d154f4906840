//! Which test next: the answers that the records leave standing, and the tests that tell them apart or narrow a
//! parameter.

use crate::diagnose::Diagnosis;
use crate::diagnose::next::{Answer, Precision, Separation, answer_of, between, narrowing};
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::study::Study;
use crate::study::error::{Error, Result};
use crate::study::hold::options_of;

/// An answer is left standing from this probability on.
const STANDING: f64 = 0.01;
/// Most answers that are set against each other.
const MOST_STANDING: usize = 3;
/// What an answer is called that adds no effect.
pub const NOTHING: &str = "none";

/// An answer and its probability, where a diagnosis gave one.
#[derive(Debug, Clone)]
pub struct Standing {
    /// The answer.
    pub answer: Answer,
    /// Its probability.
    pub probability: Option<f64>,
}

/// Two answers, and the tests that tell them apart, the most telling first.
#[derive(Debug, Clone)]
pub struct Contest {
    /// The answers.
    pub between: [Standing; 2],
    /// The tests.
    pub tests: Vec<Separation>,
}

impl Study {
    /// The answers that a diagnosis leaves standing, the most probable first.
    pub fn standing(&self, found: &Diagnosis) -> Vec<Standing> {
        let of = |name: &str, fit: &Fit, probability: f64| Standing {
            answer: answer_of(name, fit),
            probability: Some(probability),
        };
        let singles = found.candidates.iter().filter_map(|c| Some(of(&c.label, c.fit.as_ref()?, c.probability)));
        let pair = found.pair.iter().map(|p| of(&p.labels.join(" + "), &p.fit, p.probability));
        let nothing = of(NOTHING, &found.start, found.none_of_these());
        let in_pair = |s: &Standing| {
            found.pair.as_ref().is_some_and(|p| p.labels.contains(&s.answer.name) && p.probability > 0.5)
        };
        let mut all: Vec<Standing> = singles
            .filter(|s| !in_pair(s))
            .chain(pair)
            .chain([nothing])
            .filter(|s| s.probability > Some(STANDING))
            .collect();
        all.sort_by(|a, b| b.probability.partial_cmp(&a.probability).unwrap_or(std::cmp::Ordering::Equal));
        all.truncate(MOST_STANDING);
        all
    }

    /// The answer that adds an effect to a fit, or nothing.
    ///
    /// # Errors
    /// As [`Study::grow`].
    pub fn answer(&self, start: &Fit, name: &str) -> Result<Standing> {
        let answer = match name {
            NOTHING => answer_of(NOTHING, start),
            effect => answer_of(effect, &self.grow(start, effect)?.fit),
        };
        Ok(Standing { answer, probability: None })
    }

    /// The tests that tell each two of some answers apart.
    ///
    /// # Errors
    /// If an answer cannot be simulated.
    pub fn contests(&self, start: &Fit, standing: &[Standing]) -> Result<Vec<Contest>> {
        let pairs = (0..standing.len()).flat_map(|i| (i + 1..standing.len()).map(move |j| (i, j)));
        pairs.map(|(i, j)| self.contest(start, [&standing[i], &standing[j]])).collect()
    }

    fn contest(&self, start: &Fit, [one, other]: [&Standing; 2]) -> Result<Contest> {
        let options = options_of(start);
        let tests = between(self.rig(), self.runs(), start, [&one.answer, &other.answer], &options, self.watcher())?;
        Ok(Contest { between: [one.clone(), other.clone()], tests })
    }

    /// The tests that narrow a parameter of a fit, the best first.
    ///
    /// # Errors
    /// A parameter that the model does not have, that is a run's own or held; a model that cannot be simulated.
    pub fn narrowing(&self, fit: &Fit, parameter: &str) -> Result<Vec<Precision>> {
        let asked = fit.parameter(parameter)?;
        let narrowed = |p: &&FittedParameter| p.run.is_none() && !p.held;
        if !narrowed(&asked) {
            let others: Vec<&str> = fit.parameters.iter().filter(narrowed).map(|p| p.name.as_str()).collect();
            let (name, others) = (parameter.to_owned(), others.join(", "));
            return Err(if asked.held { Error::Held { name, others } } else { Error::OfARun { name, others } });
        }
        let answer = answer_of("", fit);
        Ok(narrowing(self.rig(), self.runs(), fit, &answer, parameter, &options_of(fit))?)
    }
}

/// The shared parameter that is known least, relative to its value.
pub fn least_known(fit: &Fit) -> Option<&FittedParameter> {
    let share = |p: &FittedParameter| p.standard_error() / p.value.abs();
    let shared = fit.parameters.iter().filter(|p| p.run.is_none() && !p.at_bound && share(p).is_finite());
    shared.max_by(|a, b| share(a).total_cmp(&share(b)))
}
