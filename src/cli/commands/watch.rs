//! `surgescope watch`: each recording that appears in a folder is fitted and diagnosed by itself.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use crate::cli::args::evaluation::{self, Evaluation};
use crate::cli::args::values::positive;
use crate::cli::console::document::{say_document, say_line};
use crate::cli::console::last_words::LastWords;
use crate::cli::console::outcome::{AnyError, CommandResult, Outcome};
use crate::cli::console::print::{say, tell};
use crate::cli::console::progress::progress_bar;
use crate::cli::console::stop::{STOP, stop_on_signals};
use crate::report::history::text::{RunDocument, WatchDocument};
use crate::results::history::index::{Entered, Seen};
use crate::results::history::lock::Lock;
use crate::results::history::{Index, Run, State};
use crate::rig::Rig;
use crate::shown::Shown as _;
use crate::watch::evaluate::{Ended, evaluate, sentence};
use crate::watch::folder::{Content, Listed, list, look_into};
use crate::watch::verdict::line_of;

/// How often a run is begun that the program does not survive, before it has to wait.
const MOST_TRIES: u32 = 5;

/// Fit and diagnose every recording that appears in a folder.
///
/// Each finished recording is calibrated with the rig's last accepted model and diagnosed against it. Fit
/// (NAME.fit.toml, and NAME.model.toml to continue from) and report (NAME.html) are written beside the recording, one
/// line gives the verdict, and the folder's index (surgescope.sqlite) keeps the values for `surgescope history`. Ctrl-C
/// ends the watch after the present run. It may be killed at any time: a new watch finishes what is missing. A
/// recording counts once, however often it is copied or renamed.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
    #[command(flatten)]
    evaluation: Evaluation,
    /// Read the recordings with this rig instead of the stored ones.
    #[arg(long, value_name = "RIG")]
    rig: Option<PathBuf>,
    /// Process what is there and end: exit code 1 if a run failed or was interrupted too often, 3 if a recording has no
    /// end. --json needs it.
    #[arg(long)]
    once: bool,
    /// Print each verdict as one line of JSON.
    #[arg(long)]
    json_lines: bool,
    /// Try failed runs again.
    #[arg(long)]
    retry: bool,
    /// Interval between looks at the folder, in seconds.
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = positive, allow_negative_numbers = true)]
    every: f64,
    /// A recording without an end that has not grown for this many seconds was cut off.
    #[arg(long, value_name = "S", default_value_t = 10.0, value_parser = positive, allow_negative_numbers = true)]
    torn_after: f64,
}

/// Runs it.
///
/// # Errors
/// A folder that cannot be read or is watched already, an index that cannot be written.
pub fn run(args: Args, json: bool) -> CommandResult {
    if json && !args.once {
        return Err(
            "an endless watch cannot print one document: add --once to --json, or use --json-lines for one per run"
                .into(),
        );
    }
    let torn_after = Duration::try_from_secs_f64(args.torn_after)?;
    let every = Duration::try_from_secs_f64(args.every)?;
    if !args.folder.is_dir() {
        return Err(
            format!("{} is not a folder: name the folder in which recordings appear", args.folder.shown()).into()
        );
    }
    let rig = args.rig.as_deref().map(Rig::load).transpose()?;
    let _lock = Lock::take(&args.folder)?;
    let mut watch = Watch {
        index: Index::open(&args.folder)?,
        torn_after,
        rig,
        args,
        json,
        ended: Vec::new(),
        torn: BTreeSet::new(),
        unnamed: BTreeSet::new(),
    };
    stop_on_signals()?;
    aloud(|| watch.begin())?;
    watch.look()?;
    watch.work()?;
    watch.tell_earlier_failures()?;
    while !watch.args.once && !wait(every) {
        watch.look()?;
        watch.work()?;
    }
    watch.end()
}

/// Waits; true when the program is asked to end.
fn wait(time: Duration) -> bool {
    let until = std::time::Instant::now() + time;
    while !STOP.load(Ordering::Relaxed) {
        let left = until.saturating_duration_since(std::time::Instant::now());
        if left.is_zero() {
            return false;
        }
        std::thread::sleep(left.min(Duration::from_millis(50)));
    }
    true
}

/// Says something that must not keep the watch from ending.
fn aloud<T>(say: impl FnOnce() -> T) -> T {
    let _words = LastWords::before(Outcome::Done.code(), &STOP);
    say()
}

struct Watch {
    args: Args,
    json: bool,
    torn_after: Duration,
    rig: Option<Rig>,
    index: Index,
    /// Runs that ended in this watch.
    ended: Vec<Run>,
    /// Files seen without an end.
    torn: BTreeSet<String>,
    /// Files whose names cannot stand in the index.
    unnamed: BTreeSet<PathBuf>,
}

impl Watch {
    fn folder(&self) -> &Path {
        &self.args.folder
    }

    /// Takes up what an earlier watch left.
    fn begin(&mut self) -> Result<(), AnyError> {
        let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        for run in self.index.resume(MOST_TRIES, now.as_secs() as i64)? {
            if self.index.run(run.id)?.error.is_none() {
                tell!("{}: was interrupted and is processed again", run.file.shown());
            }
        }
        if self.args.retry {
            let again = self.index.retry()?;
            tell!("{again} failed run{} tried again", if again == 1 { " is" } else { "s are" });
        }
        let all = self.index.all()?;
        let count = |state| all.iter().filter(|r| r.state == state).count();
        let (done, failed) = (count(State::Done), count(State::Failed));
        let until = if self.args.once { "" } else { "; Ctrl-C ends" };
        tell!("watching {}: {done} runs done, {failed} failed{until}", self.folder().shown());
        Ok(())
    }

    /// Says which recordings failed in earlier watches and still stand there: they count as those that fail now.
    fn tell_earlier_failures(&mut self) -> Result<(), AnyError> {
        let known = |id: i64| self.ended.iter().any(|run| run.id == id);
        let all = self.index.all()?;
        let earlier = all.iter().filter(|run| run.state == State::Failed && !known(run.id));
        let earlier = earlier.filter(|run| self.folder().join(&run.file).exists());
        earlier.map(|run| run.id).collect::<Vec<_>>().into_iter().try_for_each(|id| self.tell_end(id))
    }

    /// Looks for recordings that are new.
    fn look(&mut self) -> Result<(), AnyError> {
        let (listed, unnamed) =
            list(self.folder()).map_err(|e| format!("cannot list the folder {}: {e}", self.folder().shown()))?;
        for path in unnamed {
            if !self.unnamed.contains(&path) {
                aloud(|| tell!("{}: its name is not UTF-8, so it is skipped: rename it", path.shown()));
                self.unnamed.insert(path);
            }
        }
        for file in listed {
            if STOP.load(Ordering::Relaxed) {
                break;
            }
            match self.index.seen(&file.name)? {
                Some(Seen::Run(_)) => {}
                Some(Seen::Torn) if self.args.once => {
                    aloud(|| tell!("{}: still has no end", file.name.file.shown()));
                    self.torn.insert(file.name.file);
                }
                Some(Seen::Torn) => {}
                None => self.enter(file)?,
            }
        }
        Ok(())
    }

    fn enter(&mut self, listed: Listed) -> Result<(), AnyError> {
        let file = &listed.name.file;
        // a file that cannot be read now, or has gone, is looked at again next time
        let Ok(content) = look_into(&listed.path) else { return Ok(()) };
        let folder = self.args.folder.clone();
        let is_there = |name: &str| folder.join(name).exists();
        let (identity, rig, recorded_unix_ns, error) = match content {
            Content::Unfinished => return self.unfinished(listed),
            Content::Recording { identity, rig, recorded_unix_ns } => (identity, rig, recorded_unix_ns, None),
            Content::Unreadable { identity, error } => (identity, String::new(), 0, Some(sentence(&error))),
        };
        match self.index.enter(&listed.name, &identity, (&rig, recorded_unix_ns), error.as_deref(), is_there)? {
            Entered::New(id) if error.is_some() => self.tell_end(id)?,
            Entered::New(_) => {}
            Entered::Copy(other) if other == *file => {}
            Entered::Copy(other) => {
                aloud(|| tell!("{} is a copy of {}: a recording counts once", file.shown(), other.shown()))
            }
            Entered::Moved(other) => {
                aloud(|| tell!("{} is {} under another name: it is done already", file.shown(), other.shown()))
            }
        }
        Ok(())
    }

    fn unfinished(&mut self, listed: Listed) -> Result<(), AnyError> {
        let Listed { name, path, quiet } = listed;
        let _words = LastWords::before(Outcome::Done.code(), &STOP);
        if quiet >= self.torn_after {
            tell!(
                "{}: has no end and has not grown for {:.0} s: cut off? `surgescope recover {} -o NEW.mcap` saves what is in it",
                name.file.shown(),
                quiet.as_secs_f64(),
                path.shown()
            );
            self.index.torn(&name)?;
            self.torn.insert(name.file);
        } else if self.args.once {
            tell!("{}: is still being written: left for later", name.file.shown());
            self.torn.insert(name.file);
        }
        Ok(())
    }

    /// Works on all that waits.
    fn work(&mut self) -> Result<(), AnyError> {
        while !STOP.load(Ordering::Relaxed) {
            let Some(run) = self.index.claim(None)? else { break };
            let folder = self.args.folder.clone();
            let bar = progress_bar();
            let ended = evaluate(
                &mut self.index,
                &folder,
                &run,
                self.rig.as_ref(),
                &self.args.evaluation.settings(),
                &|notice| evaluation::show(&bar, notice),
            );
            bar.finish_and_clear();
            match ended? {
                Ended::Done(run) | Ended::Failed(run) => self.tell_end(run.id)?,
                Ended::Changed => aloud(|| tell!("{}: has changed since it was seen", run.file.shown())),
            }
            // what has come meanwhile may have been recorded earlier than what waits
            self.look()?;
        }
        Ok(())
    }

    fn tell_end(&mut self, id: i64) -> Result<(), AnyError> {
        let run = self.index.run(id)?;
        let _words = LastWords::before(Outcome::Done.code(), &STOP);
        if self.args.json_lines {
            say_line(RunDocument::from(&run))?;
        } else if self.json {
            tell!("{}", line_of(&run).shown());
        } else {
            say!("{}", line_of(&run).shown());
        }
        self.ended.push(run);
        Ok(())
    }

    fn end(self) -> CommandResult {
        let _words = LastWords::before(Outcome::Done.code(), &STOP);
        let failed = self.ended.iter().any(|r| r.state == State::Failed);
        if self.json {
            let document = WatchDocument {
                folder: self.args.folder.display().to_string(),
                runs: self.ended.iter().map(RunDocument::from).collect(),
                unfinished: self.torn.iter().cloned().collect(),
            };
            say_document(document)?;
        }
        Ok(match (self.args.once, failed, self.torn.is_empty()) {
            (true, true, _) => Outcome::No,
            (true, false, false) => Outcome::DataLost,
            _ => Outcome::Done,
        })
    }
}
