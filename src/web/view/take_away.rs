//! What a person takes away from a session: the page, the fit.

use std::error::Error;

use crate::fit::outcome::fit::Fit;
use crate::fit::validate::conflict::at_bounds;
use crate::fit::validate::energy::energy_of;
use crate::report::page::html;
use crate::report::{Page, Stage};
use crate::results::fit_file::Form;
use crate::web::session::bench::Bench;

type AnyError = Box<dyn Error + Send + Sync>;

/// The static page of the model in force, with its diagnosis where there is one.
///
/// # Errors
/// No model yet.
pub fn report(bench: &Bench) -> Result<String, AnyError> {
    let fit = bench.fit().ok_or("the model is still being fitted")?;
    let study = &bench.study;
    let diagnosis = bench.diagnosis();
    let diagnoses: Vec<_> = diagnosis.iter().map(|found| (**found).clone()).collect();
    let missing = diagnoses.last().and_then(|found| found.answer());
    let stages: Vec<Stage> = std::iter::once(&*fit as &Fit).chain(missing).map(Stage::of).collect();
    let files: Vec<&str> = study.recordings().iter().map(|l| l.file.as_str()).collect();
    let warnings = study.warnings();
    Ok(html(&Page {
        title: format!("{} on rig {}", files.join(", "), study.rig().name),
        stages,
        diagnoses: &diagnoses,
        warnings: &warnings,
        energy: energy_of(study.rig(), study.runs(), &fit, 0).ok().flatten(),
        temperatures_degc: study.recordings().iter().map(|l| (l.file.clone(), l.features.temperature_degc)).collect(),
        ..Page::of(study.rig())
    }))
}

/// The fit in force, as `calibrate -o fit.toml` writes it.
///
/// # Errors
/// No model yet.
pub fn fit_file(bench: &Bench) -> Result<String, AnyError> {
    let fit = bench.fit().ok_or("the model is still being fitted")?;
    bench.study.record(&fit, &at_bounds(&fit)).text(Form::Toml)
}
