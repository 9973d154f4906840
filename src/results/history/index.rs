//! The index of a folder's recordings: a SQLite file beside them.
//!
//! A run goes from waiting to running to done or failed, each step one transaction. Its files are written before it is
//! done: whatever moment the program is killed at, a run is either done with its files there, or it is still to do.

use std::path::Path;
use std::time::Duration;

use rusqlite::{Connection, OpenFlags, OptionalExtension, Row, Transaction, TransactionBehavior, params};

use crate::results::history::error::HistoryError;
use crate::results::history::run::{Accepted, Finding, Run, State, Value};
use crate::results::history::schema::{APPLICATION, LATER_TABLES, TABLES, VERSION};

pub use crate::results::history::schema::FILE;

/// How long a statement waits for another process to finish its own.
const PATIENCE: Duration = Duration::from_secs(10);

/// How long a run that was given up for the first time waits, s; each further time twice as long, up to 2^10 times.
const FIRST_PAUSE_S: i64 = 60;

type Result<T> = std::result::Result<T, HistoryError>;

/// See the module.
#[derive(Debug)]
pub struct Index(Connection);

/// What a name in the folder leads to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Seen {
    /// This run.
    Run(i64),
    /// A file without an end; the user knows of it.
    Torn,
}

/// What a recording turned out to be.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Entered {
    /// A new run.
    New(i64),
    /// A run that is known by the name given, which still leads to it.
    Copy(String),
    /// A run that was known by another name, which is gone.
    Moved(String),
}

/// A name and the state of the file in which it need not be read again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Name {
    /// File name, from the folder.
    pub file: String,
    /// Bytes.
    pub size: i64,
    /// When it was last written to, ns since 1970.
    pub modified_ns: i64,
}

impl Index {
    /// Opens the index of a folder; makes it where there is none.
    ///
    /// # Errors
    /// A file of that name that is none, or of a newer version; one that cannot be written.
    pub fn open(folder: &Path) -> Result<Index> {
        let path = folder.join(FILE);
        let mut connection = Connection::open(&path)?;
        connection.busy_timeout(PATIENCE)?;
        connection.pragma_update(None, "foreign_keys", true)?;
        let made =
            connection.transaction_with_behavior(TransactionBehavior::Immediate).map_err(|e| unreadable(e, &path))?;
        let empty: bool = made.query_row("SELECT count(*) = 0 FROM sqlite_schema", [], |r| r.get(0))?;
        if empty {
            made.execute_batch(TABLES)?;
            made.pragma_update(None, "application_id", APPLICATION)?;
            made.pragma_update(None, "user_version", VERSION)?;
        }
        made.commit()?;
        check(&connection, &path)?;
        connection.execute_batch(LATER_TABLES)?;
        Ok(Index(connection))
    }

    /// Opens the index of a folder to read it.
    ///
    /// # Errors
    /// As [`Index::open`]; a folder without one.
    pub fn read(folder: &Path) -> Result<Index> {
        let path = folder.join(FILE);
        if !path.exists() {
            return Err(HistoryError::NoIndex(folder.to_owned()));
        }
        let connection = Connection::open_with_flags(&path, OpenFlags::SQLITE_OPEN_READ_ONLY)?;
        connection.busy_timeout(PATIENCE)?;
        check(&connection, &path)?;
        Ok(Index(connection))
    }

    /// What a name leads to, if the file is still as it was.
    ///
    /// # Errors
    /// Only of the database; likewise below.
    pub fn seen(&self, name: &Name) -> Result<Option<Seen>> {
        let mut query =
            self.0.prepare_cached("SELECT run FROM file WHERE file = ? AND size = ? AND modified_ns = ?")?;
        let run = query
            .query_row(params![name.file, name.size, name.modified_ns], |r| r.get::<_, Option<i64>>(0))
            .optional()?;
        Ok(run.map(|run| run.map_or(Seen::Torn, Seen::Run)))
    }

    /// Notes a file without an end.
    pub fn torn(&mut self, name: &Name) -> Result<()> {
        let change = self.change()?;
        note(&change, name, None)?;
        Ok(change.commit()?)
    }

    /// Enters a recording by its content. `rig` is empty and `error` says why where it cannot be read; `is_there` says
    /// of a name whether a file stands there.
    pub fn enter(
        &mut self,
        name: &Name,
        content: &str,
        (rig, recorded_unix_ns): (&str, i64),
        error: Option<&str>,
        is_there: impl Fn(&str) -> bool,
    ) -> Result<Entered> {
        let change = self.change()?;
        let known: Option<(i64, String)> = change
            .query_row("SELECT id, file FROM run WHERE content = ?", [content], |r| Ok((r.get(0)?, r.get(1)?)))
            .optional()?;
        let (run, entered) = match known {
            Some((run, file)) if file == name.file => (run, Entered::Copy(file)),
            Some((run, file)) if is_there(&file) => (run, Entered::Copy(file)),
            Some((run, file)) => {
                change.execute("UPDATE run SET file = ? WHERE id = ?", params![name.file, run])?;
                change.execute("DELETE FROM file WHERE file = ?", [&file])?;
                (run, Entered::Moved(file))
            }
            None => {
                let state = if error.is_some() { State::Failed } else { State::Waiting };
                change.execute(
                    "INSERT INTO run (content, file, rig, recorded_unix_ns, state, error) VALUES (?, ?, ?, ?, ?, ?)",
                    params![content, name.file, rig, recorded_unix_ns, state.name(), error],
                )?;
                let run = change.last_insert_rowid();
                (run, Entered::New(run))
            }
        };
        note(&change, name, Some(run))?;
        // what stood under this name before and could not be done is gone
        let gone: Vec<i64> = change
            .prepare_cached(
                "SELECT id FROM run WHERE file = ? AND id <> ? AND state = 'failed'
                 AND NOT EXISTS (SELECT 1 FROM file WHERE file.run = run.id)
                 AND NOT EXISTS (SELECT 1 FROM accepted WHERE accepted.run = run.id)",
            )?
            .query_map(params![name.file, run], |r| r.get(0))?
            .collect::<rusqlite::Result<_>>()?;
        for id in gone {
            change.execute("DELETE FROM given_up WHERE run = ?", [id])?;
            change.execute("DELETE FROM parameter WHERE run = ?", [id])?;
            change.execute("DELETE FROM run WHERE id = ?", [id])?;
        }
        change.commit()?;
        Ok(entered)
    }

    /// Begins a waiting run, the one recorded first, or the one named.
    pub fn claim(&mut self, id: Option<i64>) -> Result<Option<Run>> {
        let change = self.change()?;
        let next: Option<i64> = change
            .query_row(
                "SELECT id FROM run WHERE state = 'waiting' AND (?1 IS NULL OR id = ?1) ORDER BY recorded_unix_ns, id LIMIT 1",
                [id],
                |r| r.get(0),
            )
            .optional()?;
        if let Some(id) = next {
            change.execute("UPDATE run SET state = 'running', tries = tries + 1, error = NULL WHERE id = ?", [id])?;
        }
        change.commit()?;
        next.map(|id| self.run(id)).transpose()
    }

    /// Lets go of a run whose file has changed or gone since it was entered: what stands there now is looked at anew.
    /// One that was never done is forgotten.
    pub fn forget(&mut self, id: i64) -> Result<()> {
        let change = self.change()?;
        change.execute("DELETE FROM file WHERE run = ?", [id])?;
        change.execute("DELETE FROM run WHERE id = ? AND state = 'running'", [id])?;
        Ok(change.commit()?)
    }

    /// Runs that were cut off wait again. Those begun `most` times already are given up for a while: a crash is not to
    /// be met for ever, but who kills the program has only to come back later. Returns both, and those whose time has
    /// come. To be called with the folder locked.
    pub fn resume(&mut self, most: u32, now_unix_s: i64) -> Result<Vec<Run>> {
        let due = "(SELECT run FROM given_up WHERE again_unix_s <= ?1)";
        let which = format!("WHERE state = 'running' OR (state = 'failed' AND id IN {due})");
        let back = self.select(&which, [now_unix_s])?;
        let change = self.change()?;
        change.execute("DELETE FROM given_up WHERE again_unix_s <= ?", [now_unix_s])?;
        for run in &back {
            if run.state == State::Running && run.tries >= most {
                let pause_s = FIRST_PAUSE_S << (run.tries - most).min(10);
                let error = format!(
                    "the program ended {} times while it worked on this recording; a watch that starts {} min or more from now tries \
                     once more, `surgescope watch --retry` at once",
                    run.tries,
                    pause_s / 60
                );
                change.execute("UPDATE run SET state = 'failed', error = ? WHERE id = ?", params![error, run.id])?;
                change.execute("INSERT OR REPLACE INTO given_up VALUES (?, ?)", [run.id, now_unix_s + pause_s])?;
            } else {
                change.execute("UPDATE run SET state = 'waiting', error = NULL WHERE id = ?", [run.id])?;
            }
        }
        change.commit()?;
        Ok(back)
    }

    /// Lets failed runs wait again; says how many.
    pub fn retry(&mut self) -> Result<usize> {
        let change = self.change()?;
        let again =
            change.execute("UPDATE run SET state = 'waiting', tries = 0, error = NULL WHERE state = 'failed'", [])?;
        change.execute("DELETE FROM given_up", [])?;
        change.commit()?;
        Ok(again)
    }

    /// A run has failed.
    pub fn failed(&mut self, id: i64, error: &str) -> Result<()> {
        let change = self.change()?;
        change.execute("UPDATE run SET state = 'failed', error = ? WHERE id = ?", params![error, id])?;
        Ok(change.commit()?)
    }

    /// A run is done, its files are written; with `accepted`, its model becomes the rig's.
    pub fn done(&mut self, run: &Run, rig: &str, finding: &Finding, accepted: Option<&Accepted>) -> Result<()> {
        let change = self.change()?;
        set_finding(&change, run.id, rig, finding)?;
        if let Some(accepted) = accepted {
            accept(&change, run.id, rig, accepted)?;
        }
        Ok(change.commit()?)
    }

    /// The model in force of a rig, if any was accepted.
    pub fn in_force(&self, rig: &str) -> Result<Option<Accepted>> {
        let mut query = self.0.prepare_cached(
            "SELECT run.file, accepted.at, accepted.how, accepted.model FROM accepted JOIN run ON run.id = accepted.run
             WHERE accepted.rig = ? ORDER BY accepted.id DESC LIMIT 1",
        )?;
        let of = |r: &Row| Ok(Accepted { file: r.get(0)?, when: r.get(1)?, how: r.get(2)?, model: r.get(3)? });
        Ok(query.query_row([rig], of).optional()?)
    }

    /// The runs of a rig in the order in which they were recorded.
    pub fn runs(&self, rig: &str) -> Result<Vec<Run>> {
        self.select("WHERE rig = ? ORDER BY recorded_unix_ns, id", [rig])
    }

    /// All runs in the order in which they were recorded.
    pub fn all(&self) -> Result<Vec<Run>> {
        self.select("ORDER BY recorded_unix_ns, id", [])
    }

    /// One run.
    pub fn run(&self, id: i64) -> Result<Run> {
        let found = self.select("WHERE id = ?", [id])?;
        found.into_iter().next().ok_or_else(|| HistoryError::UnknownRun(format!("number {id}")))
    }

    /// The run of a file name, that of the recording or of a copy.
    pub fn named(&self, file: &str) -> Result<Option<Run>> {
        let of = "WHERE id = (SELECT run FROM file WHERE file = ?1) OR (file = ?1 AND NOT EXISTS (SELECT 1 FROM file WHERE file = ?1))";
        Ok(self.select(of, [file])?.into_iter().next())
    }

    /// Names of the rigs.
    pub fn rigs(&self) -> Result<Vec<String>> {
        let mut query = self.0.prepare_cached("SELECT DISTINCT rig FROM run WHERE rig <> '' ORDER BY rig")?;
        let rigs = query.query_map([], |r| r.get(0))?.collect::<rusqlite::Result<_>>()?;
        Ok(rigs)
    }

    fn change(&mut self) -> Result<Transaction<'_>> {
        Ok(self.0.transaction_with_behavior(TransactionBehavior::Immediate)?)
    }

    fn select(&self, which: &str, values: impl rusqlite::Params) -> Result<Vec<Run>> {
        let mut query = self.0.prepare_cached(&format!(
            "SELECT id, file, rig, recorded_unix_ns, state, tries, error, temperature_degC, flow_m3_s, effects, verdict, missing,
             probability, line, rmse_m, noise_m, model_file, report_file, EXISTS (SELECT 1 FROM accepted WHERE accepted.run = run.id),
             content
             FROM run {which}"
        ))?;
        let mut runs: Vec<Run> = query.query_map(values, run_of)?.collect::<rusqlite::Result<_>>()?;
        for run in &mut runs {
            if let Some(finding) = &mut run.finding {
                finding.parameters = self.parameters(run.id)?;
            }
        }
        Ok(runs)
    }

    fn parameters(&self, run: i64) -> Result<Vec<Value>> {
        let mut query = self.0.prepare_cached(
            "SELECT name, value, standard_error, unit, own FROM parameter WHERE run = ? ORDER BY place",
        )?;
        let of = |r: &Row| {
            Ok(Value { name: r.get(0)?, value: r.get(1)?, standard_error: r.get(2)?, unit: r.get(3)?, own: r.get(4)? })
        };
        let values = query.query_map([run], of)?.collect::<rusqlite::Result<_>>()?;
        Ok(values)
    }
}

fn check(connection: &Connection, path: &Path) -> Result<()> {
    let pragma = |name: &str| connection.pragma_query_value(None, name, |r| r.get::<_, i64>(0));
    if pragma("application_id").map_err(|e| unreadable(e, path))? != APPLICATION {
        return Err(HistoryError::NotOurs(path.to_owned()));
    }
    if pragma("user_version")? > VERSION {
        return Err(HistoryError::Newer(path.to_owned()));
    }
    Ok(())
}

fn unreadable(error: rusqlite::Error, path: &Path) -> HistoryError {
    match error.sqlite_error_code() {
        Some(rusqlite::ErrorCode::NotADatabase) => HistoryError::NotOurs(path.to_owned()),
        _ => error.into(),
    }
}

/// Notes that a name leads to a run, or to a torn file.
fn note(change: &Transaction, name: &Name, run: Option<i64>) -> rusqlite::Result<usize> {
    change.execute(
        "INSERT INTO file (file, size, modified_ns, run) VALUES (?1, ?2, ?3, ?4)
         ON CONFLICT (file) DO UPDATE SET size = ?2, modified_ns = ?3, run = ?4",
        params![name.file, name.size, name.modified_ns, run],
    )
}

fn set_finding(change: &Transaction, run: i64, rig: &str, finding: &Finding) -> rusqlite::Result<()> {
    change.execute(
        "UPDATE run SET state = 'done', error = NULL, rig = ?2, temperature_degC = ?3, flow_m3_s = ?4, effects = ?5, verdict = ?6,
         missing = ?7, probability = ?8, line = ?9, rmse_m = ?10, noise_m = ?11, model_file = ?12, report_file = ?13 WHERE id = ?1",
        params![
            run,
            rig,
            finding.temperature_degc,
            finding.flow_m3_s,
            finding.effects.join(","),
            finding.verdict,
            finding.missing,
            finding.probability,
            finding.line,
            finding.rmse_m,
            finding.noise_m,
            finding.model_file,
            finding.report_file
        ],
    )?;
    change.execute("DELETE FROM parameter WHERE run = ?", [run])?;
    for (place, v) in finding.parameters.iter().enumerate() {
        change.execute(
            "INSERT INTO parameter (run, place, name, value, standard_error, unit, own) VALUES (?, ?, ?, ?, ?, ?, ?)",
            params![run, place as i64, v.name, v.value, v.standard_error, v.unit, v.own],
        )?;
    }
    Ok(())
}

fn accept(change: &Transaction, run: i64, rig: &str, accepted: &Accepted) -> rusqlite::Result<usize> {
    change.execute(
        "INSERT INTO accepted (rig, run, at, how, model) VALUES (?, ?, ?, ?, ?)",
        params![rig, run, accepted.when, accepted.how, accepted.model],
    )
}

fn run_of(r: &Row) -> rusqlite::Result<Run> {
    let state: String = r.get(4)?;
    // the table admits no other word
    let state = State::by_name(&state).unwrap_or(State::Failed);
    let words = |text: String| text.split(',').filter(|w| !w.is_empty()).map(str::to_owned).collect();
    let finding = match state {
        State::Done => Some(Finding {
            temperature_degc: r.get(7)?,
            flow_m3_s: r.get(8)?,
            effects: words(r.get(9)?),
            verdict: r.get(10)?,
            missing: r.get(11)?,
            probability: r.get(12)?,
            line: r.get(13)?,
            // SQLite keeps what is not a number as NULL
            rmse_m: r.get::<_, Option<f64>>(14)?.unwrap_or(f64::NAN),
            noise_m: r.get::<_, Option<f64>>(15)?.unwrap_or(f64::NAN),
            parameters: Vec::new(),
            model_file: r.get(16)?,
            report_file: r.get(17)?,
        }),
        _ => None,
    };
    Ok(Run {
        id: r.get(0)?,
        content: r.get(19)?,
        file: r.get(1)?,
        rig: r.get(2)?,
        recorded_unix_ns: r.get(3)?,
        state,
        tries: r.get(5)?,
        error: r.get(6)?,
        accepted: r.get(18)?,
        finding,
    })
}
