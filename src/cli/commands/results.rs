//! `surgescope results`: many fits as one table.

use std::error::Error;
use std::path::{Path, PathBuf};

use serde_json::json;

use crate::campaign::folder::Folder;
use crate::campaign::table::{Gathered, gather};
use crate::cli::console::document::say_document;
use crate::cli::console::outcome::{CommandResult, Outcome};
use crate::cli::console::print::{say, tell, tell_warning};
use crate::results::fit_file::Form;
use crate::results::fit_record::FitRecord;
use crate::results::table::{Table, long, wide};
use crate::shown::Shown as _;
use crate::storage::output;

type AnyError = Box<dyn Error + Send + Sync>;

/// Put many fits into one table.
///
/// It has a row for each fit and run, with errors, parameters and their standard errors. Of the folder of a campaign,
/// it has a row for each task, sorted by the tasks' names, and no times: it is the same however the tasks were done.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Fits that `calibrate -o` wrote, or folders of them; other files in a folder are skipped. Or the folder of a
    /// campaign.
    #[arg(required = true, value_name = "FIT|FOLDER")]
    fits: Vec<PathBuf>,
    /// Table to write, as .csv or .parquet; must not exist.
    #[arg(short, long, value_name = "CSV|PARQUET")]
    output: PathBuf,
    /// Write a row for each parameter instead, with bounds and scale.
    #[arg(long)]
    long: bool,
    /// Replace an existing output, unless it is a recording or one of the fits.
    #[arg(long)]
    overwrite: bool,
}

/// Runs it.
///
/// # Errors
/// A file that is no fit, a folder without any, a table that may not or cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    let ends_with = |ending: &str| args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    if !ends_with("csv") && !ends_with("parquet") {
        return Err(format!("{}: the name of the table must end with .csv or .parquet", args.output.shown()).into());
    }
    if let [one] = &args.fits[..]
        && let Ok(folder) = Folder::open(one)
    {
        if args.long {
            return Err("--long is for fits: the table of a campaign has a row for each task".into());
        }
        return campaign(&folder, &args, json);
    }
    let mut fits: Vec<(String, FitRecord)> = Vec::new();
    for path in &args.fits {
        if path.is_dir() {
            fits.extend(fits_in(path)?);
        } else if !path.exists() {
            return Err(output::missing(path).into());
        } else {
            fits.push((path.shown().into_owned(), FitRecord::read(path)?));
        }
    }
    for (i, (name, _)) in fits.iter().enumerate() {
        if let Some((twin, _)) = fits[..i].iter().find(|(n, _)| output::same_file(Path::new(n), Path::new(name))) {
            return Err(match twin == name {
                true => format!("{name} is given twice: a fit counts once"),
                false => format!("{twin} and {name} are the same fit: it counts once"),
            }
            .into());
        }
    }
    if let Some((name, _)) = fits.iter().find(|(name, _)| output::same_file(Path::new(name), &args.output)) {
        return Err(format!("{name} is one of the fits: choose another name for the table").into());
    }
    let table = if args.long { long(&fits) } else { wide(&fits) };
    write(&table, &args)?;
    if json {
        let document =
            json!({ "file": args.output, "fits": fits.len(), "rows": table.rows.len(), "columns": table.columns });
        say_document(document)?;
    } else {
        say!(
            "{}: {} rows of {} fits, {} columns",
            args.output.shown(),
            table.rows.len(),
            fits.len(),
            table.columns.len()
        );
    }
    Ok(Outcome::Done)
}

/// The table in the form that its name asks for.
fn write(table: &Table, args: &Args) -> Result<(), AnyError> {
    let mut content = Vec::new();
    match args.output.extension().is_some_and(|e| e.eq_ignore_ascii_case("parquet")) {
        true => content = table.parquet(),
        false => table.write_csv(&mut content)?,
    }
    output::write_new(&args.output, &content, args.overwrite)
}

/// The table of a campaign.
fn campaign(folder: &Folder, args: &Args, json: bool) -> CommandResult {
    let Gathered { table, missing, failed, programs, damaged } = gather(folder)?;
    write(&table, args)?;
    if programs.len() > 1 {
        tell_warning!(
            "the rows are of {} programs, whose numbers may differ (column 'program'): {}. `surgescope campaign status {}` says how to have them of one",
            programs.len(),
            programs.iter().map(|program| program.shown().into_owned()).collect::<Vec<_>>().join(", "),
            folder.root().shown()
        );
    }
    // one that was done again is in another file
    for file in damaged.iter().filter(|_| missing > 0) {
        tell_warning!("{} has lines that were cut off or damaged: their tasks count as missing", file.shown());
    }
    if missing + failed > 0 {
        tell_warning!(
            "{missing} tasks are missing and {failed} have failed: `surgescope campaign status {}` says more",
            folder.root().shown()
        );
    }
    let (rows, columns) = (table.rows.len(), table.columns.len());
    if json {
        say_document(json!({
            "file": args.output, "rows": rows, "columns": table.columns, "missing": missing, "failed": failed,
        }))?;
    } else {
        say!("{}: {rows} tasks, {columns} columns", args.output.shown());
    }
    Ok(Outcome::Done)
}

/// The fits of a folder by name; files of models and expected results stand in the same folders.
fn fits_in(folder: &Path) -> Result<Vec<(String, FitRecord)>, AnyError> {
    let failed = |e| format!("cannot list the folder {}: {e}", folder.shown());
    let entries = std::fs::read_dir(folder).map_err(failed)?.collect::<Result<Vec<_>, _>>().map_err(failed)?;
    let mut paths: Vec<PathBuf> = entries.into_iter().map(|e| e.path()).filter(|p| Form::of(p).is_ok()).collect();
    paths.sort();
    let read = |p: PathBuf| FitRecord::read(&p).ok().map(|fit| (p.shown().into_owned(), fit));
    let (asked, fits) = (paths.len(), paths.into_iter().filter_map(read).collect::<Vec<_>>());
    if fits.is_empty() {
        return Err(format!("the folder {} contains no fit (see `calibrate -o`)", folder.shown()).into());
    }
    if fits.len() < asked {
        tell!("{}: skipped {} files that are not fits", folder.shown(), asked - fits.len());
    }
    Ok(fits)
}
