//! The model in force: its error, its parameters, where it fails.

use serde_json::{Value, json};

use crate::diagnose::residual_patterns::{by_cycle, residual_patterns};
use crate::fit::numeric::quantiles::Z_95;
use crate::fit::outcome::fit::{Fit, FittedParameter};
use crate::fit::outcome::uncertainty::Uncertainty;
use crate::report::calibration::posterior::chart;
use crate::results::fit_record::Parameter;
use crate::results::model_file::Entry;
use crate::web::session::Session;
use crate::web::session::actions::index_of;
use crate::web::session::bench::Bench;
use crate::web::session::jobs::Busy;

type AnyError = Box<dyn std::error::Error + Send + Sync>;

/// Two parameters that are correlated more than this move together.
const TOGETHER: f64 = 0.98;

/// The model in force, once it is fitted.
pub fn json(bench: &Bench) -> Option<Value> {
    let fit = bench.fit()?;
    let (rmse_m, noise_m) = fit.pooled();
    let failings: Vec<Value> = residual_patterns(&fit)
        .into_iter()
        .map(|p| {
            let (from_s, to_s) = p.worst.map_or((None, None), |worst| (Some(worst.from_s), Some(worst.to_s)));
            json!({
                "text": p.sentence(), "error": p.error, "clauses": p.clauses, "run": p.run, "sensor": p.sensor,
                "from_s": from_s, "to_s": to_s,
            })
        })
        .collect();
    Some(json!({
        "number": bench.file().in_force, "effects": fit.labels(), "rmse_m": rmse_m, "noise_m": noise_m,
        "converged": fit.converged, "reaches": fit.reaches,
        "parameters": parameters(bench, &fit), "fails": failings, "cycles": cycles(&fit), "commands": bench.commands,
    }))
}

/// All models with their parameters, to be compared.
///
/// # Errors
/// Nothing is open.
pub fn all(session: &Session) -> Result<Value, AnyError> {
    let bench = session.bench().ok_or(Busy::Nothing)?;
    let of =
        |(i, model): (usize, &Entry)| json!({ "number": i + 1, "name": model.name, "parameters": model.parameters });
    Ok(bench.file().models.iter().enumerate().map(of).collect())
}

fn parameters(bench: &Bench, fit: &Fit) -> Vec<Value> {
    let described = |(j, owner): (usize, Option<usize>)| {
        let p = &fit.parameters[j];
        let mut value = json!(Parameter::from(p));
        value["about"] = json!(p.about);
        value["log"] = json!(value["scale"] == "log");
        value["effect"] = json!(owner.map(|i| fit.effects[i].label()));
        value["line"] = json!(owner.map(|i| fit.effects[i].line(bench.study.rig())));
        value["advice"] = json!(advice(fit, j, p, owner.is_some()));
        value
    };
    bench.study.owners(fit).into_iter().enumerate().map(described).collect()
}

/// What to do about a parameter, of an effect or of the base model, that the fit does not settle.
fn advice(fit: &Fit, j: usize, p: &FittedParameter, of_effect: bool) -> Option<String> {
    let out = of_effect.then_some(", or take its effect out");
    if p.at_bound {
        let or = out.unwrap_or(", or see what is missing");
        return Some(format!("at its bound: check the rig file, widen the bounds{or}"));
    }
    match p.uncertainty {
        Uncertainty::Open => {
            let or = out.unwrap_or_default();
            return Some(format!("the recording does not determine it: hold it{or}"));
        }
        // of a fit that ended at no optimum nothing is known of any parameter: the page says so once
        Uncertainty::NotAtOptimum | Uncertainty::Held => return None,
        _ => {}
    }
    let correlations = fit.correlation.get(j)?.iter().enumerate().filter(|&(i, r)| i != j && r.abs() > TOGETHER);
    let (other, _) = correlations.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some(format!(
        "moves together with {}: hold one of them, or add a run that tells them apart",
        fit.parameters[other].name
    ))
}

/// How well the fit knows a parameter: its interval, what it trades with, strongest first, and its profile and the
/// posterior of the model where they were asked for.
///
/// # Errors
/// No model yet, a parameter that it does not have.
pub fn known(bench: &Bench, name: &str, run: Option<&str>) -> Result<Value, AnyError> {
    let fit = bench.fit().ok_or("the model is still being fitted")?;
    let j = index_of(&fit, name, run)?;
    // a fit that ended at no optimum has none
    let correlations = fit.correlation.get(j).into_iter().flatten();
    let others = fit.parameters.iter().zip(correlations).enumerate();
    let mut trades: Vec<(f64, Value)> = others
        .filter(|(i, (_, r))| *i != j && r.is_finite())
        .map(|(_, (p, &r))| {
            let about = json!({
                "name": p.name, "run": p.run, "unit": p.unit, "correlation": r, "value": p.value,
                "standard_error": p.known_error(),
            });
            (r.abs(), about)
        })
        .collect();
    trades.sort_by(|a, b| b.0.total_cmp(&a.0));
    let profile = bench.profile(j).map(|p| {
        json!({
            "points": p.points, "interval_95": [p.interval_95.0, p.interval_95.1], "linear_95": [p.linear_95.0, p.linear_95.1],
            "threshold": Z_95 * Z_95, "best": p.best, "fell_by": p.fell_by, "unknown_beyond": p.unknown_beyond,
            "unresolved": p.unresolved, "disagrees": p.disagrees(),
        })
    });
    let posterior =
        chart(&fit).map(|of| json!({ "how": of.how, "reservation": of.reservation, "picture": of.picture }));
    Ok(json!({
        "model": bench.file().in_force, "parameter": Parameter::from(&fit.parameters[j]),
        "trades_with": trades.into_iter().map(|(_, about)| about).collect::<Vec<_>>(), "profile": profile,
        "posterior": posterior,
    }))
}

fn cycles(fit: &Fit) -> Vec<Value> {
    let runs = fit.runs.iter().enumerate();
    let sensors = runs.flat_map(|(r, run)| run.sensors.iter().enumerate().map(move |(s, sensor)| (r, s, sensor)));
    let row = |(r, s, sensor): (usize, usize, &crate::fit::outcome::fit::SensorFit)| {
        let cells: Vec<Value> = by_cycle(sensor)
            .into_iter()
            .map(|c| {
                let over_noise = c.rms_m / sensor.noise_m;
                json!({ "cycle": c.cycle, "from_s": c.from_s, "to_s": c.to_s, "over_noise": over_noise })
            })
            .collect();
        json!({ "run": r, "sensor": s, "name": sensor.name, "cells": cells })
    };
    sensors.map(row).collect()
}
