//! A diagnosis as JSON (see the contract) and as text.

use std::fmt::Write;

use serde::Serialize;

use crate::diagnose::visible::Visible;
use crate::diagnose::{Candidate, Diagnosis, Pair, RivalPair, Verdict};
use crate::model::effects::name_of;
use crate::report::diagnosis::rest::{self, Explained};
use crate::report::diagnosis::words::{evidence, rival_pairs};
use crate::report::text::number::{error_m, grouped, probability, significant, with_error};
use crate::results::fit_record::Parameter;
use crate::signal::faults::SensorFault;

#[derive(Serialize)]
struct Document<'a> {
    verdict: &'static str,
    probability: f64,
    start: StartModel<'a>,
    candidates: Vec<Rival<'a>>,
    pair: Option<Both<'a>>,
    next_test: &'a str,
    rest: Vec<Explained<'a>>,
    fails: &'a [String],
    not_tried: Vec<LeftOut<'a>>,
    least_visible: Vec<Least<'a>>,
    warnings: &'a [String],
}

#[derive(Serialize)]
struct Least<'a> {
    effect: &'a str,
    parameter: &'a str,
    value: f64,
    unit: &'a str,
}

#[derive(Serialize)]
struct LeftOut<'a> {
    effect: &'a str,
    reason: &'a str,
}

#[derive(Serialize)]
struct StartModel<'a> {
    runs: Vec<&'a str>,
    effects: Vec<String>,
    rmse_m: f64,
    noise_m: f64,
    /// The search began at a fit that keeps to what the instruments say.
    held: bool,
    held_out_m: Option<f64>,
    parameters: Vec<Parameter>,
}

#[derive(Serialize)]
struct Both<'a> {
    effects: [&'a str; 2],
    labels: &'a [String; 2],
    probability: f64,
    evidence: f64,
    rmse_m: f64,
    indistinguishable_from: Vec<OtherPair<'a>>,
    parameters: Vec<Parameter>,
}

#[derive(Serialize)]
struct OtherPair<'a> {
    labels: &'a [String; 2],
    probability: f64,
}

#[derive(Serialize)]
struct Rival<'a> {
    effect: &'a str,
    label: &'a str,
    probability: f64,
    /// Of an effect of the pair: that it is missing without the other.
    #[serde(skip_serializing_if = "Option::is_none")]
    probability_alone: Option<f64>,
    evidence: f64,
    rmse_m: f64,
    held_out_m: Option<f64>,
    indistinguishable_from: &'a [&'static str],
    parameters: Vec<Parameter>,
}

/// The JSON document of `diagnose --json`: the last diagnosis and, where there were several, `steps`, all of them.
///
/// # Errors
/// None in practice: all values can be written.
pub fn value(diagnoses: &[Diagnosis], faults: &[SensorFault]) -> serde_json::Result<serde_json::Value> {
    let mut last = serde_json::to_value(diagnoses.last().map(document))?;
    last["sensor_faults"] = serde_json::to_value(faults)?;
    if diagnoses.len() > 1 {
        last["steps"] = serde_json::to_value(diagnoses.iter().map(document).collect::<Vec<_>>())?;
    }
    Ok(last)
}

/// The same as text.
///
/// # Errors
/// None in practice: all values can be written.
pub fn json(diagnoses: &[Diagnosis], faults: &[SensorFault]) -> serde_json::Result<String> {
    serde_json::to_string_pretty(&value(diagnoses, faults)?)
}

fn document(diagnosis: &Diagnosis) -> Document<'_> {
    let (rmse_m, noise_m) = diagnosis.start.pooled();
    Document {
        verdict: diagnosis.verdict.name(),
        probability: diagnosis.probability,
        start: StartModel {
            runs: diagnosis.start.runs.iter().map(|r| r.file.as_str()).collect(),
            effects: diagnosis.start.labels(),
            rmse_m,
            noise_m,
            held: diagnosis.is_held,
            held_out_m: diagnosis.held_out_m,
            parameters: diagnosis.start.parameters.iter().map(Parameter::from).collect(),
        },
        least_visible: diagnosis
            .visible
            .iter()
            .map(|v| Least { effect: &v.effect, parameter: &v.parameter, value: v.value, unit: v.unit })
            .collect(),
        candidates: diagnosis.candidates.iter().map(|c| rival(c, diagnosis.pair.as_ref())).collect(),
        pair: diagnosis.pair.as_ref().map(|pair| both(pair, &diagnosis.rival_pairs)),
        next_test: diagnosis.next_test.as_deref().unwrap_or(""),
        rest: diagnosis.rest.iter().map(Explained::from).collect(),
        fails: &diagnosis.residual_patterns,
        warnings: &diagnosis.warnings,
        not_tried: diagnosis.left_out.iter().map(|(effect, reason)| LeftOut { effect, reason }).collect(),
    }
}

fn both<'a>(pair: &'a Pair, rivals: &'a [RivalPair]) -> Both<'a> {
    Both {
        effects: pair.effects,
        labels: &pair.labels,
        probability: pair.probability,
        evidence: pair.evidence,
        rmse_m: pair.fit.pooled().0,
        indistinguishable_from: rivals
            .iter()
            .map(|other| OtherPair { labels: &other.labels, probability: other.probability })
            .collect(),
        parameters: pair.fit.parameters.iter().map(Parameter::from).collect(),
    }
}

fn rival<'a>(candidate: &'a Candidate, pair: Option<&Pair>) -> Rival<'a> {
    let pair = pair.filter(|pair| pair.effects.contains(&candidate.effect));
    Rival {
        probability_alone: pair.map(|pair| (candidate.probability - pair.probability).max(0.0)),
        effect: candidate.effect,
        label: &candidate.label,
        probability: candidate.probability,
        evidence: candidate.evidence,
        rmse_m: candidate.rmse_m,
        held_out_m: candidate.held_out_m,
        indistinguishable_from: &candidate.indistinguishable_from,
        parameters: candidate.parameters.iter().map(Parameter::from).collect(),
    }
}

/// Candidates that the text shows.
const SHOWN: usize = 5;

/// The diagnosis for people.
pub fn text(diagnosis: &Diagnosis) -> String {
    let (rmse_m, noise_m) = diagnosis.start.pooled();
    let model = name_of(&diagnosis.start.effects);
    let mut out = format!("{model}: RMSE {} m, noise {} m\n", error_m(rmse_m), error_m(noise_m));
    for sentence in &diagnosis.residual_patterns {
        let _ = writeln!(out, "  {sentence}");
    }
    for (i, doubt) in diagnosis.warnings.iter().enumerate() {
        let _ = writeln!(out, "{}warning: {doubt}", if i == 0 { "\n" } else { "" });
    }
    let _ = match (diagnosis.verdict, diagnosis.candidates.first()) {
        (Verdict::NothingMissing, _) => {
            writeln!(
                out,
                "\nNothing is missing (probability {}): no effect of the catalogue is worth adding.",
                probability(diagnosis.probability)
            )
        }
        (Verdict::UnknownEffect, Some(_)) => {
            let nearest = diagnosis.candidates.iter().min_by(|a, b| a.rmse_m.total_cmp(&b.rmse_m));
            let nearest = nearest
                .map_or(String::new(), |c| format!("; the nearest, {}, leaves {} m", c.effect, error_m(c.rmse_m)));
            let p = probability(diagnosis.probability);
            let check = match diagnosis.start_is_far() {
                true => "\nCheck the rig file first: a wrong length, wall, bore or place of a sensor looks alike.",
                false => "",
            };
            writeln!(
                out,
                "\nSomething is missing that no effect of the catalogue explains (probability {p}){nearest}.{check}"
            )
        }
        (Verdict::UnknownEffect, None) => {
            writeln!(out, "\nSomething is missing that no effect of the catalogue explains.")
        }
        (Verdict::MissingEffect, Some(best)) => writeln!(
            out,
            "\n{}{}. With {}, RMSE {} m → {} m.",
            named(diagnosis),
            reservations(diagnosis),
            if diagnosis.pair.is_some() { "both" } else { "it" },
            error_m(rmse_m),
            error_m(diagnosis.answer().map_or(best.rmse_m, |fit| fit.pooled().0))
        ),
        (Verdict::MissingEffect, None) => Ok(()),
    };
    out += &rest::text(&diagnosis.rest);
    if let Some(best) = diagnosis.candidates.first()
        && let (Some(without), Some(with)) = (diagnosis.held_out_m, best.held_out_m)
    {
        let _ = writeln!(
            out,
            "Refitted to the first three fifths of the record, the model misses the rest by {} m with {}, by {} m without.",
            error_m(with),
            diagnosis.answer_label(),
            error_m(without)
        );
    }
    if !diagnosis.visible.is_empty() {
        let least: Vec<String> =
            diagnosis.visible.iter().map(|v| format!("  {}, {} {}", v.effect, v.parameter, least_visible(v))).collect();
        let _ = writeln!(out, "\nToo small to be seen in this record:\n{}", least.join("\n"));
    }
    if diagnosis.verdict == Verdict::MissingEffect {
        for p in diagnosis.answer_parameters() {
            let unit = if p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
            let value = with_error(p.value, p.standard_error());
            // A unit belongs to the number, not to the words behind it.
            let (number, words) = value.split_once(' ').unwrap_or((&value, ""));
            let _ = writeln!(out, "{}", format!("  {} = {number}{unit} {words}", p.name).trim_end());
        }
    }
    let both = if diagnosis.pair.is_some() { diagnosis.answer_label() } else { String::new() };
    let width = both.len().max(20);
    if diagnosis.verdict != Verdict::NothingMissing {
        let _ = writeln!(
            out,
            "\n{:<width$} {:>11} {:>11} {:>8}  cannot be distinguished from",
            "effect", "probability", "ln odds", "RMSE, m"
        );
        if let Some(pair) = &diagnosis.pair {
            let (p, rmse) = (probability(pair.probability), error_m(pair.fit.pooled().0));
            let rivals = rival_pairs(&diagnosis.rival_pairs);
            let row = format!("{both:<width$} {p:>11} {:>11} {rmse:>8}  {rivals}", grouped(pair.evidence));
            let _ = writeln!(out, "{}", row.trim_end());
        }
        for c in diagnosis.candidates.iter().take(SHOWN) {
            let _ = writeln!(
                out,
                "{:<width$} {:>11} {:>11} {:>8}  {}",
                c.effect,
                if diagnosis.pair.as_ref().is_some_and(|pair| pair.effects.contains(&c.effect)) {
                    "in the pair".to_owned()
                } else {
                    probability(c.probability)
                },
                evidence(c),
                error_m(c.rmse_m),
                c.indistinguishable_from.join(", ")
            );
        }
    }
    if diagnosis.verdict != Verdict::NothingMissing {
        let _ = writeln!(out, "{:<width$} {:>11}", "none of these", probability(diagnosis.none_of_these()));
    }
    for (i, (effect, reason)) in diagnosis.left_out.iter().enumerate() {
        let _ = writeln!(out, "{}Not tried: {effect}: {reason}.", if i == 0 { "\n" } else { "" });
    }
    if let Some(test) = &diagnosis.next_test {
        let _ = writeln!(out, "\nNext test: {test}.");
    }
    out
}

/// What is missing, as firmly as its probability allows.
fn named(diagnosis: &Diagnosis) -> String {
    let (label, p) = (diagnosis.answer_label(), diagnosis.probability);
    if p >= 0.5 {
        return format!("Missing: {label} (probability {})", probability(p));
    }
    let outside = diagnosis.none_of_these();
    format!(
        "Something is missing; most likely {label} (probability {}, another effect {}, none of the catalogue {})",
        probability(p),
        probability((1.0 - p - outside).max(0.0)),
        probability(outside)
    )
}

/// What speaks against the answer, to stand in the same sentence.
fn reservations(diagnosis: &Diagnosis) -> String {
    let with = diagnosis.candidates.first().and_then(|c| c.held_out_m);
    let no_better = matches!((with, diagnosis.held_out_m), (Some(with), Some(without)) if with > 0.98 * without);
    let own = diagnosis.answer_parameters().iter();
    let at_bound: Vec<&str> = own.filter(|p| p.at_bound).map(|p| p.name.as_str()).collect();
    let mut out = String::new();
    if no_better {
        out += ", but it predicts the end of the record no better than the start model";
    }
    if !at_bound.is_empty() {
        out += &format!("{} {} at a bound", if no_better { ", and with" } else { ", but with" }, at_bound.join(", "));
    }
    out
}

/// The range of a parameter in which its effect could not be seen, in words.
pub(crate) fn least_visible(v: &Visible) -> String {
    let unit = if v.unit == "1" { String::new() } else { format!(" {}", v.unit) };
    if v.vanishes_at == 0.0 {
        return format!("under {}{unit}", significant(v.value, 2));
    }
    format!("within {} ± {}{unit}", v.vanishes_at, significant((v.value - v.vanishes_at).abs(), 2))
}
