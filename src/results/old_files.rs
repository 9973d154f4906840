//! Files that an earlier version wrote, kept in `tests/fixtures/results`, stay readable: fits (TOML, JSON), models, an
//! index.
//!
//! They were made from `recordings/copper-leak.mcap`: `calibrate -o` with a held value and with a profile,
//! `calibrate --save` then `add`, `watch --once` then `accept`.

use std::path::{Path, PathBuf};

use crate::results::fit_file::Form;
use crate::results::fit_record::FitRecord;
use crate::results::history::{History, Index, State};
use crate::results::model_file::{Entry, ModelFile};

fn kept(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/results").join(name)
}

fn text(name: &str) -> String {
    std::fs::read_to_string(kept(name)).unwrap()
}

fn models(name: &str) -> ModelFile {
    ModelFile::parse(&text(name), &kept(name)).unwrap()
}

#[test]
fn a_fit_in_toml_with_a_held_value_opens() {
    let fit = FitRecord::read(&kept("held.fit.toml")).unwrap();
    assert_eq!((fit.effects.as_slice(), fit.runs[0].file.as_str()), (&["leak".to_owned()][..], "copper-leak.mcap"));
    assert_eq!((fit.rmse_m, fit.parameters.len()), (4.912258771246531, 10));
    let (speed, place) = (&fit.parameters[0], &fit.parameters[1]);
    assert!(speed.held && speed.standard_error.is_none() && speed.interval_95[0].is_nan());
    assert_eq!((speed.value, speed.scale.as_str()), (1280.0, "log"));
    assert!(speed.correlation.iter().all(|r| r.is_nan()));
    assert!(place.at_bound && place.interval_95[1].is_infinite());
    assert_eq!(place.profile.as_ref().unwrap()[0], (93.15479928213607, 17.209232581218394));
}

#[test]
fn a_fit_in_json_with_a_profile_opens() {
    let fit = FitRecord::read(&kept("profiled.fit.json")).unwrap();
    let place = fit.parameters.iter().find(|p| p.name == "leak_position_m").unwrap();
    assert_eq!((place.value, place.standard_error), (2.342808271320441, Some(0.164138688036039)));
    assert_eq!(place.interval_95, [2.1641752207199487, 2.5300238133148087]);
    assert!(place.profile.as_ref().unwrap().len() > 3 && fit.converged);
}

/// Every value of `old` is in `new` as it was; `new` may have more keys.
fn assert_holds(new: &serde_json::Value, old: &serde_json::Value, place: &str) {
    match (new, old) {
        (serde_json::Value::Object(new), serde_json::Value::Object(old)) => {
            for (key, value) in old {
                let found = new.get(key).unwrap_or_else(|| panic!("{place}.{key} is gone"));
                assert_holds(found, value, &format!("{place}.{key}"));
            }
        }
        (serde_json::Value::Array(new), serde_json::Value::Array(old)) => {
            assert_eq!(new.len(), old.len(), "{place}");
            new.iter().zip(old).for_each(|(new, old)| assert_holds(new, old, place));
        }
        _ => assert_eq!(new, old, "{place}"),
    }
}

#[test]
fn a_fit_that_is_written_again_says_the_same() {
    for (name, form) in
        [("held.fit.toml", Form::Toml), ("profiled.fit.json", Form::Json), ("watched.fit.toml", Form::Toml)]
    {
        let tree = |text: &str| -> serde_json::Value {
            match form {
                Form::Toml => serde_json::to_value(text.parse::<toml::Table>().unwrap()).unwrap(),
                Form::Json => serde_json::from_str(text).unwrap(),
            }
        };
        let written = FitRecord::read(&kept(name)).unwrap().text(form).unwrap();
        assert_holds(&tree(&written), &tree(&text(name)), name);
        let kept = FitRecord::read(&kept(name)).unwrap();
        let again = FitRecord::parse(&kept.text(form).unwrap(), form, name).unwrap();
        assert_eq!(format!("{again:?}"), format!("{kept:?}"), "{name}");
    }
}

#[test]
fn models_that_grew_out_of_each_other_open() {
    let file = models("grown.model.toml");
    assert_eq!((file.in_force, file.models.len()), (2, 2));
    let [base, leak] = &file.models[..] else { panic!("two models") };
    assert!(base.effects.is_empty() && leak.effects == ["leak"] && leak.grown_from == Some(1));
    assert!(leak.evidence.unwrap() > 50.0 && base.parameters[0].standard_error == Some(0.7390263179023124));
    for name in ["grown.model.toml", "watched.model.toml"] {
        assert_eq!(models(name).text().unwrap(), text(name), "{name}");
    }
}

#[test]
fn an_index_of_runs_opens() {
    let index = Index::read(&kept("")).unwrap();
    let history = History::of(&index, "copper-leak").unwrap();
    let run = &history.runs[0];
    assert_eq!((run.state, run.file.as_str(), run.accepted), (State::Done, "copper-leak.mcap", true));
    let finding = run.finding.as_ref().unwrap();
    assert_eq!((finding.verdict.as_str(), finding.missing.as_deref()), ("missing-effect", Some("leak")));
    let file = models("watched.model.toml");
    assert_eq!(
        (finding.effects.as_slice(), finding.rmse_m),
        (file.current().effects.as_slice(), file.current().rmse_m)
    );
    assert_eq!(finding.parameters.len(), file.current().parameters.len());
    for (value, p) in finding.parameters.iter().zip(&file.current().parameters) {
        assert_eq!((&value.name, value.value, value.standard_error), (&p.name, p.value, p.standard_error));
        assert_eq!(value.own, p.run.is_some());
    }
    let accepted: Entry = toml::from_str(&history.in_force.unwrap().model).unwrap();
    assert!(accepted.effects.contains(&"leak".to_owned()));
}
