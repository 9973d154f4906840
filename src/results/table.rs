//! Many fits as one table: a row for each fit and run, or for each parameter.

use std::collections::HashMap;
use std::io::Write;

use crate::results::fit_record::{FitRecord, Parameter, Run};
use crate::results::parquet::{Column, parquet};
use crate::shown::cell;

/// Columns that each row of a wide table begins with.
const RUN_COLUMNS: [&str; 13] = [
    "fit",
    "file",
    "rig",
    "fitted_at",
    "recorded_at",
    "temperature_degC",
    "flow_m3_s",
    "effects",
    "method",
    "converged",
    "rmse_m",
    "noise_m",
    "mape_extrema_percent",
];

/// What follows a parameter's name in the columns of its standard error and of the ends of its 95% interval.
const SUFFIXES: [&str; 3] = ["_standard_error", "_lower_95", "_upper_95"];

/// Columns of a long table.
const LONG_COLUMNS: [&str; 19] = [
    "fit",
    "file",
    "rig",
    "fitted_at",
    "effects",
    "method",
    "parameter",
    "run",
    "value",
    "standard_error",
    "lower_95",
    "upper_95",
    "interval_by",
    "unit",
    "at_bound",
    "held",
    "lower",
    "upper",
    "scale",
];

/// Columns that hold texts, in tables of fits and of campaigns; all others hold numbers.
const TEXTS: [&str; 30] = [
    "fit",
    "file",
    "rig",
    "fitted_at",
    "recorded_at",
    "effects",
    "method",
    "converged",
    "parameter",
    "run",
    "interval_by",
    "unit",
    "at_bound",
    "held",
    "scale",
    "task",
    "kind",
    "case",
    "recordings",
    "seed",
    "state",
    "reason",
    "fitted_effects",
    "verdict",
    "answer",
    "best",
    "indistinguishable_from",
    "truth",
    "right",
    "sensor",
];

/// A table of text; an empty cell is what is not known.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Names of the columns, all different.
    pub columns: Vec<String>,
    /// Rows, each as long as `columns`.
    pub rows: Vec<Vec<String>>,
}

/// A row for each run of each fit, with the parameters that hold for it, their standard errors and intervals. `fits`
/// come with the name of their files. A column is empty where a fit has no such parameter.
pub fn wide(fits: &[(String, FitRecord)]) -> Table {
    let mut names: Vec<&str> = Vec::new();
    for parameter in fits.iter().flat_map(|(_, fit)| &fit.parameters) {
        if !names.contains(&parameter.name.as_str()) {
            names.push(&parameter.name);
        }
    }
    let of_parameters =
        names.iter().flat_map(|n| [""].into_iter().chain(SUFFIXES).map(move |suffix| format!("{n}{suffix}")));
    let columns = RUN_COLUMNS.iter().map(|c| (*c).to_owned()).chain(of_parameters).collect();
    let row = |name: &str, fit: &FitRecord, run: &Run| {
        let of_run = |p: &&Parameter| p.run.as_ref().is_none_or(|r| *r == run.file);
        let own: HashMap<&str, &Parameter> =
            fit.parameters.iter().filter(of_run).map(|p| (p.name.as_str(), p)).collect();
        let mut cells = vec![
            name.to_owned(),
            run.file.clone(),
            fit.rig.clone(),
            fit.fitted_at.clone(),
            run.recorded_at.clone().unwrap_or_default(),
            number(run.temperature_degc),
            number(run.flow_m3_s),
            fit.effects.join(" "),
            fit.method.clone(),
            fit.converged.to_string(),
            number(Some(run.rmse_m)),
            number(Some(run.noise_m)),
            number(Some(run.mape_extrema_percent)),
        ];
        for name in &names {
            let parameter = own.get(name);
            cells.push(number(parameter.map(|p| p.value)));
            cells.push(number(parameter.and_then(|p| fitted(p)?.standard_error)));
            cells.extend([0, 1].map(|end| number(parameter.and_then(|p| fitted(p)).map(|p| p.interval_95[end]))));
        }
        cells
    };
    let rows = fits.iter().flat_map(|(name, fit)| fit.runs.iter().map(move |run| row(name, fit, run))).collect();
    Table { columns, rows }
}

/// A row for each parameter of each fit; `file` lists the fit's recordings, `run` is that of a parameter which they do
/// not share.
pub fn long(fits: &[(String, FitRecord)]) -> Table {
    let row = |name: &str, fit: &FitRecord, p: &Parameter| {
        vec![
            name.to_owned(),
            fit.runs.iter().map(|r| r.file.as_str()).collect::<Vec<_>>().join(" "),
            fit.rig.clone(),
            fit.fitted_at.clone(),
            fit.effects.join(" "),
            fit.method.clone(),
            p.name.clone(),
            p.run.clone().unwrap_or_default(),
            number(Some(p.value)),
            number(fitted(p).and_then(|p| p.standard_error)),
            number(fitted(p).map(|p| p.interval_95[0])),
            number(fitted(p).map(|p| p.interval_95[1])),
            fitted(p).filter(|p| !p.interval_95[0].is_nan()).map_or("", interval_by).to_owned(),
            p.unit.clone(),
            p.at_bound.to_string(),
            p.held.to_string(),
            number(Some(p.lower)),
            number(Some(p.upper)),
            p.scale.clone(),
        ]
    };
    let rows = fits.iter().flat_map(|(name, fit)| fit.parameters.iter().map(move |p| row(name, fit, p))).collect();
    Table { columns: LONG_COLUMNS.iter().map(|c| (*c).to_owned()).collect(), rows }
}

/// None for what was held: its error is no result.
fn fitted(p: &Parameter) -> Option<&Parameter> {
    (!p.held).then_some(p)
}

fn interval_by(p: &Parameter) -> &'static str {
    if p.profile.is_some() { "profile" } else { "linear" }
}

/// As many digits as it takes to read the same number back.
fn number(value: Option<f64>) -> String {
    value.filter(|v| v.is_finite()).map(|v| v.to_string()).unwrap_or_default()
}

impl Table {
    /// As Parquet: texts, and numbers with NaN for what is not known.
    pub fn parquet(&self) -> Vec<u8> {
        let is_text = |name: &str| TEXTS.contains(&name) || name.ends_with("_at_bound");
        let texts: Vec<Vec<&str>> =
            (0..self.columns.len()).map(|c| self.rows.iter().map(|row| row[c].as_str()).collect()).collect();
        let numbers = |(name, column): (&String, &Vec<&str>)| match is_text(name) {
            true => Vec::new(),
            false => column.iter().map(|text| text.parse().unwrap_or(f64::NAN)).collect(),
        };
        let numbers: Vec<Vec<f64>> = self.columns.iter().zip(&texts).map(numbers).collect();
        let typed = self.columns.iter().zip(texts.iter().zip(&numbers)).map(|(name, (texts, numbers))| {
            (name.clone(), if is_text(name) { Column::Texts(texts) } else { Column::Numbers(numbers) })
        });
        parquet(&typed.collect::<Vec<_>>())
    }

    /// As CSV (RFC 4180, lines end with a line feed).
    ///
    /// # Errors
    /// If `out` cannot be written to.
    pub fn write_csv(&self, out: impl Write) -> csv::Result<()> {
        let mut csv = csv::Writer::from_writer(out);
        let mut write = |row: &[String]| csv.write_record(row.iter().map(|text| cell(text).into_owned()));
        write(&self.columns)?;
        self.rows.iter().try_for_each(|row| write(row))?;
        csv.flush()?;
        Ok(())
    }
}
