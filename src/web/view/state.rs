//! All that a page needs to draw a session.

use std::sync::Arc;

use serde_json::{Value, json};

use crate::model::effects::{Effect, Site, catalogue_of};
use crate::report::rig_plan::Plan;
use crate::report::view::panel::OwnUnit;
use crate::results::fit_record::recorded_at;
use crate::rig::check::return_time_s;
use crate::rig::{Rig, SensorKind, Upstream};
use crate::study::open::Loaded;
use crate::web::session::bench::Bench;
use crate::web::session::new_rig::name_of;
use crate::web::session::place::Run;
use crate::web::session::recording::commands;
use crate::web::session::{Session, glances};
use crate::web::view::model;

/// The state of a session.
pub fn json(session: &Session) -> Value {
    let bench = session.bench();
    let bench = bench.as_deref();
    let file = bench.map(Bench::file);
    let models: Vec<Value> = file.iter().flat_map(|file| file.models.iter().enumerate()).map(listed).collect();
    let diagnosis = bench.and_then(|bench| bench.diagnosis_json(&*bench.diagnosis()?).ok());
    json!({
        "version": env!("CARGO_PKG_VERSION"),
        "place": session.place().words(),
        "folder": session.place().folder().is_some(),
        "table": session.place().table().map(name_of),
        "tables": session.place().tables().iter().map(|path| name_of(path)).collect::<Vec<_>>(),
        "runs": session.place().runs().iter().map(|run| of_run(session, run)).collect::<Vec<_>>(),
        "open": bench.map(open),
        "model": bench.and_then(model::json),
        "models": models,
        "can_undo": file.as_ref().is_some_and(|f| !f.models.is_empty() && f.current().grown_from.is_some()),
        "can_redo": file.as_ref().is_some_and(|f| f.next().is_some()),
        "file": bench.and_then(|bench| Some(bench.model_path.file_name()?.to_string_lossy().into_owned())),
        "job": session.jobs.current().map(|job| json!({
            "id": job.id, "what": job.what, "progress": job.progress, "errors": job.errors,
            "iteration": job.errors.last().map(|(n, _)| n), "rmse_m": job.errors.last().map(|(_, rmse_m)| rmse_m),
        })),
        "failed": session.jobs.failed(),
        "diagnosis": diagnosis,
        "recording": session.recorder.json(),
        "can_record": can_record(session),
        "commands": session.rig().map_or(Vec::new(), |rig| commands(&rig)),
        "has_trigger": session.rig().is_some_and(|rig| rig.sensors.iter().any(|s| s.kind == SensorKind::Trigger)),
    })
}

/// How a recording may be made: on the rig's devices, or simulated; none without a rig.
fn can_record(session: &Session) -> Vec<&'static str> {
    let Some(rig) = session.rig() else { return Vec::new() };
    let wired = rig.sensors.iter().any(|sensor| sensor.wiring.is_some());
    wired.then_some("devices").into_iter().chain(cfg!(unix).then_some("simulated")).collect()
}

fn listed((i, model): (usize, &crate::results::model_file::Entry)) -> Value {
    json!({
        "number": i + 1, "name": model.name, "grown_from": model.grown_from, "effects": model.effects,
        "rmse_m": model.rmse_m, "noise_m": model.noise_m, "why": model.why, "when": model.when,
        "evidence": model.evidence,
    })
}

/// A run: what is or was open as it stands, the others as the folder's index knows them.
fn of_run(session: &Session, run: &Run) -> Value {
    let finding = run.known.as_ref().and_then(|known| known.finding.as_ref());
    let mut about = json!({
        "id": run.id.to_string(), "name": run.name(), "open": false,
        "rig": run.known.as_ref().map(|known| &known.rig), "when": run.known.as_ref().and_then(|known| known.when.as_ref()),
        "temperature_degC": finding.and_then(|f| f.temperature_degc), "flow_m3_s": finding.and_then(|f| f.flow_m3_s),
        "rmse_m": finding.map(|f| f.rmse_m), "noise_m": finding.map(|f| f.noise_m),
        "kept": false, "effects": finding.map(|f| &f.effects), "verdict": finding.map(|f| &f.verdict), "effect": finding.and_then(|f| f.missing.as_ref()), "spark": [],
    });
    let Some(bench) = session.benches.with(&run.path) else { return about };
    let Some(i) = bench.paths.iter().position(|path| *path == run.path) else { return about };
    let loaded = &bench.study.recordings()[i];
    let is_open = session.bench().is_some_and(|open| Arc::ptr_eq(&open, &bench));
    about["open"] = json!(is_open);
    about["kept"] = json!(true);
    about["rig"] = json!(bench.study.rig().name);
    about["when"] = json!(recorded_at(loaded.recording.run.start_unix_ns));
    about["temperature_degC"] = json!(loaded.measured_temperature_degc());
    about["flow_m3_s"] = json!(loaded.features.flow_m3_s.map(|q| q.value));
    // what is not open has its sparkline from a glance
    about["spark"] = json!(if is_open { spark(&bench, i) } else { Vec::new() });
    if let Some((fit, of_run)) = bench.fit().and_then(|fit| Some((fit.labels(), fit.runs.get(i)?.clone()))) {
        (about["rmse_m"], about["noise_m"]) = (json!(of_run.rmse_m), json!(of_run.noise_m));
        if about["effects"] != json!(fit) {
            // what the index knows is the verdict on another model
            (about["verdict"], about["effect"]) = (Value::Null, Value::Null);
        }
        about["effects"] = json!(fit);
    }
    if let Some(found) = bench.diagnosis() {
        about["verdict"] = json!(found.verdict.name());
        about["effect"] = json!(found.answer().map(|_| found.answer_label()));
    }
    about
}

fn spark(bench: &Bench, run: usize) -> Vec<f64> {
    let Some(sensor) = bench.study.runs()[run].sensors.last() else { return Vec::new() };
    glances::spark(&sensor.head_m)
}

fn open(bench: &Bench) -> Value {
    let study = &bench.study;
    let names: Vec<&str> = study.recordings().iter().map(|l| l.file.as_str()).collect();
    let runs: Vec<Value> = study.recordings().iter().enumerate().map(|(r, l)| opened(bench, r, l)).collect();
    json!({
        "title": format!("{} · {}", names.join(", "), study.rig().name), "rig": rig(study.rig()), "runs": runs,
        "warnings": study.warnings(),
    })
}

fn opened(bench: &Bench, r: usize, loaded: &Loaded) -> Value {
    let (rig, data) = (bench.study.rig(), &bench.study.runs()[r]);
    let start_s = bench.closure_start_s(r);
    let fit = bench.fit();
    let times = || data.sensors.iter().filter_map(|s| Some((*s.time_s.first()?, *s.time_s.last()?)));
    let sensors: Vec<Value> = (data.sensors.iter().enumerate())
        .map(|(s, sensor)| {
            let own = OwnUnit::of(rig, &sensor.sensor.name, loaded.features.temperature_degc);
            let fitted = fit.as_ref().and_then(|fit| fit.runs.get(r)?.sensors.get(s));
            json!({
                "name": sensor.sensor.name, "line": sensor.sensor.line, "position_m": sensor.sensor.position_m, "samples": sensor.time_s.len(),
                "noise_m": sensor.total_noise_m, "rmse_m": fitted.map(|f| f.rmse_m),
                "unit": own.map(|u| json!({ "symbol": u.symbol, "per_m": u.per_m, "zero": u.zero })),
            })
        })
        .collect();
    json!({
        "name": loaded.file, "sensors": sensors,
        "from_s": times().map(|(from, _)| from - start_s).fold(f64::INFINITY, f64::min),
        "to_s": times().map(|(_, to)| to - start_s).fold(f64::NEG_INFINITY, f64::max),
        "period_s": loaded.features.period.map(|p| p.value),
        "flow_m3_s": loaded.features.flow_m3_s.map(|q| q.value),
        "velocity_m_s": data.start.velocity_m_s.0,
        "temperature_degC": loaded.measured_temperature_degc(),
        "recorded_at": recorded_at(loaded.recording.run.start_unix_ns),
    })
}

/// The rig, with where its parts are drawn: shares of the drawing's width to the right and down.
fn rig(rig: &Rig) -> Value {
    let (graph, plan) = (&rig.graph, Plan::of(rig));
    let mut pipes = Vec::new();
    for k in 0..graph.lines.len() {
        let mut from_m = 0.0;
        for p in rig.pipes_of(k) {
            pipes.push(json!({
                "name": p.name, "line": k, "from_m": from_m, "to_m": from_m + p.length_m,
                "inner_diameter_m": p.inner_diameter_m, "material": p.material,
            }));
            from_m += p.length_m;
        }
    }
    let lines: Vec<Value> = (plan.lines.iter().enumerate())
        .map(|(k, corners)| {
            let name = (graph.lines.len() > 1).then(|| &rig.pipes_of(k)[0].name);
            json!({ "name": name, "length_m": rig.line_length_m(k), "corners": corners })
        })
        .collect();
    let supply = match rig.upstream {
        Upstream::Pump => "pump",
        Upstream::Reservoir => "reservoir",
        Upstream::Measured => "measured",
    };
    let nodes: Vec<Value> = (graph.nodes.iter().enumerate())
        .map(|(n, node)| {
            let kind = if n == graph.supply() && rig.upstream == Upstream::Pump { "pump" } else { node.kind.name() };
            json!({ "name": node.name, "kind": kind, "at": plan.nodes[n], "outward": plan.outward(graph, n) })
        })
        .collect();
    json!({
        "name": rig.name, "length_m": rig.length_m(), "supply": supply, "pipes": pipes, "lines": lines, "nodes": nodes,
        "valve": graph.valve, "located": located(rig),
    })
}

/// The effects that stand at a place along the pipe, each with the parameter that is its place.
fn located(rig: &Rig) -> Vec<Value> {
    let water = rig.fluid.properties(rig.fluid.temperature_degc);
    let site = Site { rig, water: &water, period_s: 2.0 * return_time_s(rig, &water), line: rig.graph.line_to_valve() };
    let of = |effect: &&'static dyn Effect| {
        let parameters = effect.parameters(&site, 1);
        let place = |ending: &str| {
            parameters.iter().find(|p| p.name.ends_with(ending) || p.name == ending[1..]).map(|p| p.name.clone())
        };
        let (from, to) = (place("_position_m").or(place("_start_m")), place("_end_m"));
        from.map(|from| json!({ "effect": effect.name(), "from": from, "to": to }))
    };
    catalogue_of(rig).iter().filter(|effect| effect.impossible(rig).is_none()).filter_map(of).collect()
}
