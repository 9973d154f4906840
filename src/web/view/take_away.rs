//! What a person takes away from a session: the page, the fit.

use std::error::Error;

use crate::fit::validate::conflict::warnings;
use crate::fit::validate::energy::energy_of;
use crate::report::page::html;
use crate::report::view::panel::OwnUnit;
use crate::report::{Page, Stage, page_title};
use crate::results::fit_file::Form;
use crate::results::fit_record::FitRecord;
use crate::web::session::bench::Bench;
use crate::web::view::packed::Packed;

type AnyError = Box<dyn Error + Send + Sync>;

/// The static page of the model in force beside those that it grew out of, with its diagnosis where there is one.
///
/// # Errors
/// No model yet.
pub fn report(bench: &Bench) -> Result<String, AnyError> {
    let fit = bench.fit().ok_or("the model is still being fitted")?;
    let study = &bench.study;
    let diagnosis = bench.diagnosis();
    let diagnoses: Vec<_> = diagnosis.iter().map(|found| (**found).clone()).collect();
    let missing = diagnoses.last().and_then(|found| found.answer());
    let fits = bench.fits();
    let stages: Vec<Stage> = fits.iter().map(|fit| &**fit).chain(missing).map(Stage::of).collect();
    let files: Vec<&str> = study.recordings().iter().map(|l| l.file.as_str()).collect();
    let warnings = study.warnings();
    Ok(html(&Page {
        title: page_title(&files, study.rig()),
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
    let record = bench.study.record(&fit, &warnings(&fit, bench.study.runs()));
    FitRecord { fitted_at: bench.file().current().when.clone(), ..record }.text(Form::Toml)
}

/// What a chart shows as a table: heads, or pressures in the sensor's own unit, and what the model leaves; with a name
/// for its file.
pub fn as_table(bench: &Bench, (run, sensor): (usize, usize), own_unit: bool, curves: &Packed) -> (String, Packed) {
    let loaded = &bench.study.recordings()[run];
    let name = &bench.study.runs()[run].sensors[sensor].sensor.name;
    let unit = OwnUnit::of(bench.study.rig(), name, loaded.features.temperature_degc).filter(|_| own_unit);
    let (symbol, per_m, zero) = unit.map_or(("m", 1.0, 0.0), |u| (u.symbol, u.per_m, u.zero));
    let mut table = Packed::default();
    for (column, values) in curves.columns() {
        match column.strip_suffix("_m") {
            Some(of) => table
                .push(format!("{of}_{symbol}"), values.iter().map(|head_m| rounded(head_m * per_m + zero)).collect()),
            None => table.push(column.clone(), values.clone()),
        }
    }
    let of = |column: &str| curves.columns().iter().find(|(known, _)| known == column).map(|(_, values)| values);
    if let (Some(measured), Some(model)) = (of("measured_m"), of("model_m")) {
        let left = measured.iter().zip(model).map(|(measured, model)| (model - measured) * per_m);
        table.push(format!("error_{symbol}"), left.collect());
    }
    let stem = loaded.file.rsplit_once('.').map_or(loaded.file.as_str(), |(stem, _)| stem);
    let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '_' };
    (format!("{stem}-{name}").chars().map(plain).collect(), table)
}

/// To the digits that a conversion of units leaves of a recorded number.
fn rounded(value: f64) -> f64 {
    format!("{value:.11e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_converted_number_has_no_digits_that_mean_nothing() {
        assert_eq!(rounded(259.239_600_000_000_05).to_string(), "259.2396");
        assert_eq!(rounded(-0.25), -0.25);
        assert!(rounded(f64::NAN).is_nan());
    }
}
