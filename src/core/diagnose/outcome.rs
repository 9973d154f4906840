//! The outcome of a diagnosis, as plain data.

use crate::diagnose::limits::WORSE_PREDICTION;
use crate::diagnose::rest::explanation::Explanation;
use crate::diagnose::visible::Visible;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::search::thresholds::DOUBTFUL_ABOVE;
use crate::interned::Text;
use crate::number::probability;

/// The verdict of a diagnosis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Verdict {
    /// An effect of the catalogue is missing.
    MissingEffect,
    /// The residual is noise.
    NothingMissing,
    /// Something is missing that no effect of the catalogue explains.
    UnknownEffect,
}

impl Verdict {
    /// Its name in JSON.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::MissingEffect => "missing-effect",
            Verdict::NothingMissing => "nothing-missing",
            Verdict::UnknownEffect => "unknown-effect",
        }
    }
}

/// An effect that may be missing.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Candidate {
    /// Its name in the catalogue.
    #[serde(deserialize_with = "crate::interned::text")]
    pub effect: Text,
    /// The form that fits best, as on the command line.
    pub label: String,
    /// The probability that it is the one that is missing.
    pub probability: f64,
    /// Evidence for it over the start model, natural logarithm of odds before tempering.
    pub evidence: f64,
    /// RMSE over the last two fifths of the records after a fit to what comes before, m; of the best candidate only.
    pub held_out_m: Option<f64>,
    /// Error over noise: each sensor's error in units of its own noise, rms.
    pub over_noise: f64,
    /// Its values are within what every rig has of it (see [`crate::model::effects::Effect::noteworthy`]).
    pub within_class: bool,
    /// RMSE with it, m: of the full fit if there is one, else as the coarse refit forecasts it.
    pub rmse_m: f64,
    /// Its own parameters.
    pub parameters: Vec<FittedParameter>,
    /// Other effects that these data cannot tell apart from it.
    #[serde(deserialize_with = "crate::interned::texts")]
    pub indistinguishable_from: Vec<&'static str>,
    /// The full fit, if there is one.
    pub fit: Option<Fit>,
}

/// Two effects that explain together what neither explains alone.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Pair {
    /// Their names in the catalogue.
    #[serde(deserialize_with = "crate::interned::pair")]
    pub effects: [&'static str; 2],
    /// Their forms, as on the command line.
    pub labels: [String; 2],
    /// The probability that both are missing.
    pub probability: f64,
    /// Evidence for both over the start model, natural logarithm of odds before tempering.
    pub evidence: f64,
    /// Error over noise with both.
    pub over_noise: f64,
    /// The parameters of both.
    pub parameters: Vec<FittedParameter>,
    /// The fit with both.
    pub fit: Fit,
}

/// Two effects that explain the records nearly as well as the [`Pair`] that is the answer.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct RivalPair {
    /// Their forms, as on the command line.
    pub labels: [String; 2],
    /// The probability that both are missing.
    pub probability: f64,
    /// Error over noise with both.
    pub over_noise: f64,
}

/// The outcome of a diagnosis.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Diagnosis {
    /// The verdict.
    pub verdict: Verdict,
    /// The probability that it is right.
    pub probability: f64,
    /// The start model, fitted: the least that it leaves without what is missing.
    pub start: Fit,
    /// The search began not at that fit but at one that keeps to what the instruments say.
    pub is_held: bool,
    /// Reasons to doubt the rest, one sentence each.
    pub warnings: Vec<String>,
    /// Where the start model fails, one sentence each.
    pub residual_patterns: Vec<String>,
    /// Effects that could be missing, best first.
    pub candidates: Vec<Candidate>,
    /// The two effects that are the answer, where no single one is.
    pub pair: Option<Pair>,
    /// Other pairs that these records cannot tell from it, the most probable first.
    pub rival_pairs: Vec<RivalPair>,
    /// Effects that were not tried, each with the reason.
    #[serde(deserialize_with = "crate::interned::with_words")]
    pub left_out: Vec<(&'static str, String)>,
    /// RMSE of the start model over the last two fifths of the records after a fit to what comes before, m.
    pub held_out_m: Option<f64>,
    /// The least of each effect that these recordings would show, if nothing is missing.
    pub visible: Vec<Visible>,
    /// The test that would tell the best candidates apart, if these data cannot.
    pub next_test: Option<String>,
    /// What would explain the records where no effect of the catalogue does, the most probable first.
    #[serde(default)]
    pub rest: Vec<Explanation>,
}

impl Diagnosis {
    /// Whether the start model leaves so much that a wrong rig file may be the cause.
    pub fn start_is_far(&self) -> bool {
        let (rmse_m, noise_m) = self.start.pooled();
        rmse_m > DOUBTFUL_ABOVE * noise_m
    }

    /// The start model with what is missing, where something is and could be fitted.
    pub fn answer(&self) -> Option<&Fit> {
        let single = self.candidates.first().and_then(|c| c.fit.as_ref());
        let found = self.pair.as_ref().map(|pair| &pair.fit).or(single);
        found.filter(|_| self.verdict == Verdict::MissingEffect)
    }

    /// The probability that no effect of the catalogue is missing. One that is missing in a pair may also be missing
    /// alone.
    pub fn none_of_these(&self) -> f64 {
        let rivals = self.rival_pairs.iter().map(|pair| pair.probability).sum::<f64>();
        let in_pair = self.pair.as_ref().map_or(0.0, |pair| pair.probability) + rivals;
        (1.0 - self.candidates.iter().map(|c| c.probability).sum::<f64>() + in_pair).max(0.0)
    }

    /// Evidence for what is missing.
    pub fn answer_evidence(&self) -> f64 {
        let single = self.candidates.first().map_or(0.0, |c| c.evidence);
        self.pair.as_ref().map_or(single, |pair| pair.evidence)
    }

    /// The parameters of what is missing.
    pub fn answer_parameters(&self) -> &[FittedParameter] {
        let single = self.candidates.first().map_or(&[][..], |c| &c.parameters);
        self.pair.as_ref().map_or(single, |pair| &pair.parameters)
    }

    /// What is missing, as on the command line: one effect, or two.
    pub fn answer_label(&self) -> String {
        match (&self.pair, self.candidates.first()) {
            (Some(pair), _) => pair.labels.join(" and "),
            (None, Some(best)) => best.label.clone(),
            (None, None) => String::new(),
        }
    }

    /// Why the answer joins a model, in the words of a model file.
    pub fn reason(&self) -> String {
        format!("diagnosed: {} missing, probability {}", self.answer_label(), probability(self.probability))
    }

    /// Whether the most probable effect makes the model predict the end of the records worse.
    pub fn predicts_worse(&self) -> bool {
        let with = self.candidates.first().and_then(|c| c.held_out_m);
        matches!((with, self.held_out_m), (Some(with), Some(without)) if with > WORSE_PREDICTION * without)
    }
}
