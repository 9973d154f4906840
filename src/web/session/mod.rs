//! What is open in the workbench, and what may be done with it.

pub mod actions;
pub mod arrival;
pub mod bench;
pub mod benches;
pub mod events;
pub mod glances;
pub mod jobs;
pub mod new_rig;
pub mod place;
pub mod recording;
pub mod samples;

use std::collections::{BTreeSet, VecDeque};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde_json::{Value, json};

use crate::record::health::disk::DiskWatch;
use crate::record::health::snapshot::Disk;
use crate::rig::Rig;
use crate::storage::recover;
use crate::watch::folder::list;
use crate::web::session::actions::Action;
use crate::web::session::arrival::Dropped;
use crate::web::session::bench::{Bench, Commands};
use crate::web::session::benches::Benches;
use crate::web::session::events::Hub;
use crate::web::session::glances::Glances;
use crate::web::session::jobs::{Busy, Jobs};
use crate::web::session::new_rig::{Asked, Tables, free, name_of};
use crate::web::session::place::{NoSuchRun, Place, Run};
use crate::web::session::recording::{Recorder, Wanted};

type AnyError = Box<dyn Error + Send + Sync>;

/// How long an action waits for the recordings to be read and fitted before it says that the workbench is busy.
const OPENING: Duration = Duration::from_secs(120);

/// One workbench.
pub struct Session {
    place: Place,
    commands: Commands,
    /// What is open, and what was.
    pub benches: Benches,
    /// The job at work.
    pub jobs: Arc<Jobs>,
    /// What pages hear.
    pub hub: Arc<Hub>,
    /// The recording that runs.
    pub recorder: Arc<Recorder>,
    /// Runs that are looked at without being opened.
    pub glances: Glances,
    /// Tables of which rigs are made.
    pub tables: Tables,
    /// The disk that a recording fills; whoever asks waits for the disk, the recorder does not.
    pub disk: Mutex<DiskWatch>,
    /// Recordings that have come since the first was started here.
    arrivals: Mutex<Arrivals>,
}

/// Recordings that are made while the workbench is open.
#[derive(Default)]
struct Arrivals {
    /// The folder they come to, and what lay there before or has been taken up.
    folder: Option<(PathBuf, BTreeSet<PathBuf>)>,
    /// Those that wait to be opened, and whether they are diagnosed then.
    waiting: VecDeque<(PathBuf, bool)>,
}

impl Session {
    /// A session at a place; its first run is being opened. `commands` says what a person would type for an action.
    pub fn new(place: Place, commands: Commands) -> Arc<Session> {
        let hub = Arc::new(Hub::default());
        let session = Arc::new(Session {
            place,
            commands,
            benches: Benches::default(),
            jobs: Arc::new(Jobs::new(hub.clone())),
            hub,
            recorder: Arc::default(),
            glances: Glances::default(),
            tables: Tables::default(),
            disk: Mutex::default(),
            arrivals: Mutex::default(),
        });
        let first = session.place.first();
        if !first.is_empty() {
            // nothing else can be at work
            let _ = session.open(first, false);
        }
        session
    }

    /// Where the runs lie.
    pub fn place(&self) -> &Place {
        &self.place
    }

    /// What is open.
    pub fn bench(&self) -> Option<Arc<Bench>> {
        self.benches.open()
    }

    /// Waits until the job at work has ended, at most for some time; false where it has not.
    pub fn wait(&self, most: Duration) -> bool {
        self.jobs.wait(most)
    }

    /// Opens runs together, as they were left where they were open before; fits the base model where they have none,
    /// and diagnoses it if that is wished. Returns the job's number.
    ///
    /// # Errors
    /// If a job is at work.
    pub fn open(self: &Arc<Self>, runs: Vec<Run>, diagnose: bool) -> Result<u64, Busy> {
        let session = self.clone();
        self.jobs.start("opening", true, move |jobs| {
            let paths: Vec<PathBuf> = runs.into_iter().map(|run| run.path).collect();
            let bench = match session.benches.left(&paths) {
                Some(left) => left,
                None => Arc::new(Bench::open(paths, session.place.model_file(), session.commands, jobs.clone())?),
            };
            jobs.set_noise_m(bench.noise_m);
            session.benches.put(bench.clone());
            session.hub.changed();
            bench.fit_in_force()?;
            session.hub.model();
            if diagnose { session.carry_out(&bench, &Action::Diagnose) } else { Ok(()) }
        })
    }

    /// Starts an action on what is open. Returns the job's number.
    ///
    /// # Errors
    /// If nothing is open, or a job is at work.
    pub fn act(self: &Arc<Self>, action: Action) -> Result<u64, Busy> {
        self.jobs.wait_for_opening(OPENING);
        let bench = self.bench().ok_or(Busy::Nothing)?;
        let session = self.clone();
        self.jobs.start(&action.words(), false, move |_| session.carry_out(&bench, &action))
    }

    fn carry_out(&self, bench: &Bench, action: &Action) -> Result<(), AnyError> {
        if let Some(diagnosis) = bench.act(action)? {
            self.hub.send("diagnosis", &bench.diagnosis_json(&diagnosis)?);
        }
        self.hub.model();
        Ok(())
    }

    /// The rig to record on: the one that was named, or that of the runs that are open.
    pub fn rig(&self) -> Option<Rig> {
        self.place.rig().cloned().or_else(|| Some(self.bench()?.study.rig().clone()))
    }

    /// Velocity and head before the closure of the run whose rig is in use, by the names of their settings: a simulated
    /// test is like it where nothing else is set. None where the rig is known from its file alone.
    pub fn before_the_open_run(&self) -> Vec<(String, f64)> {
        let Some(bench) = self.bench().filter(|_| self.place.rig().is_none()) else { return Vec::new() };
        let start = &bench.study.runs()[0].start;
        let (velocity, head) = (start.velocity_m_s.0, start.valve_head_m.0);
        vec![("initial_velocity_m_s".to_owned(), velocity), ("valve_head_m".to_owned(), head)]
    }

    /// Room on the disk that the recording fills, or would fill, and how long it lasts at this rate; null where nobody
    /// knows.
    pub fn room(&self) -> Value {
        let place = self.recorder.growing().unwrap_or_else(|| self.folder());
        let disk = self.disk.lock().unwrap_or_else(PoisonError::into_inner).look(&place);
        let lasts_s = |disk: Disk| Some(disk.lasts_s()).filter(|s| s.is_finite());
        json!(disk.map(
            |disk| json!({ "free_bytes": disk.free_bytes, "bytes_per_s": disk.bytes_per_s, "lasts_s": lasts_s(disk) })
        ))
    }

    /// Where recordings are written.
    fn folder(&self) -> PathBuf {
        let beside = || Some(self.bench()?.paths.first()?.parent()?.to_owned());
        let folder = self.place.folder().map(Path::to_owned).or_else(beside).unwrap_or_default();
        if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder }
    }

    /// Starts a recording. Each recording that comes of it is opened and diagnosed.
    ///
    /// # Errors
    /// No rig, one that cannot record this, a recording that runs already.
    pub fn record(&self, wanted: &Wanted) -> Result<(), AnyError> {
        let rig = self.rig().ok_or("open a rig file, or a recording of the rig, to record on it")?;
        let folder = self.folder();
        let known = list(&folder)?.0.into_iter().map(|file| file.path).collect();
        let mut wanted = wanted.clone();
        if wanted.simulate {
            for (name, value) in self.before_the_open_run() {
                wanted.set.entry(name).or_insert(value);
            }
        }
        self.recorder.start(&rig, &folder, &wanted, &self.hub)?;
        self.arrivals().folder = Some((folder, known));
        Ok(())
    }

    /// Looks at a file that was dropped on the page; where that is agreed, it becomes a recording and is opened. A
    /// table without a rig is kept, and named as one that needs a rig ([`Session::new_rig`]).
    ///
    /// # Errors
    /// A file that is no recording of its rig, a folder that cannot be written to.
    pub fn import(self: &Arc<Self>, dropped: &Dropped) -> Result<Value, AnyError> {
        let rig = match &dropped.rig_of {
            Some(id) => {
                let runs = self.place.named(&[id.parse().map_err(|_| NoSuchRun)?])?;
                Some(self.glances.study(&runs[0].path)?.rig().clone())
            }
            None => self.rig(),
        };
        let rig = rig.filter(|_| !dropped.new_rig);
        let (mut about, written) = arrival::take(dropped, rig.as_ref(), &self.folder())?;
        if about["needs_rig"].is_string() {
            self.tables.keep(&dropped.unpacked()?)?;
        }
        written.into_iter().for_each(|path| self.take_up(path, &mut about));
        Ok(about)
    }

    /// Looks at a table with a form beside it; where that is agreed, rig and recording are written, and the recording
    /// is opened.
    ///
    /// # Errors
    /// As [`Tables::take`].
    pub fn new_rig(self: &Arc<Self>, asked: &Asked) -> Result<Value, AnyError> {
        let (mut about, written) = self.tables.take(asked, &self.place.tables(), &self.folder())?;
        written.into_iter().for_each(|path| self.take_up(path, &mut about));
        Ok(about)
    }

    /// Saves what is in a recording that was cut off, beside it, and opens that.
    ///
    /// # Errors
    /// A run that does not exist, a file of which nothing can be saved, a folder that cannot be written to.
    pub fn recover(self: &Arc<Self>, id: usize) -> Result<Value, AnyError> {
        let torn = self.place.named(&[id])?.remove(0).path;
        let stem = torn.file_stem().unwrap_or_default().to_string_lossy();
        let out = free(&self.folder(), &format!("{stem}-recovered"), "mcap");
        let saved = recover(&torn, &out)?;
        let mut about =
            json!({ "written": name_of(&out), "lost": saved.lost.iter().map(ToString::to_string).collect::<Vec<_>>() });
        self.take_up(out, &mut about);
        Ok(about)
    }

    /// Opens a recording that was written here, at once or when the job at work has ended.
    fn take_up(self: &Arc<Self>, path: PathBuf, about: &mut Value) {
        let run = self.place.add(path.clone());
        about["run"] = json!(run.id.to_string());
        let job = self.open(vec![run], false).ok();
        about["job"] = json!(job);
        let mut arrivals = self.arrivals();
        if let Some((_, known)) = &mut arrivals.folder {
            known.insert(path.clone());
        }
        if job.is_none() {
            arrivals.waiting.push_back((path, false));
        }
    }

    fn arrivals(&self) -> MutexGuard<'_, Arrivals> {
        self.arrivals.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes up what has come: runs of the folder, recordings that were made here, and what another program has written
    /// to the model file.
    pub fn look(self: &Arc<Self>) {
        if self.place.has_changed() {
            self.hub.changed();
        }
        self.look_for_arrivals();
        if self.jobs.at_work() {
            return;
        }
        let next = self.arrivals().waiting.pop_front();
        match next {
            Some((path, diagnose)) => {
                let run = self.place.add(path.clone());
                if self.open(vec![run], diagnose).is_err() {
                    // somebody was faster
                    self.arrivals().waiting.push_front((path, diagnose));
                }
            }
            None => self.look_outside(),
        }
    }

    fn look_for_arrivals(&self) {
        let growing = self.recorder.growing();
        let mut arrivals = self.arrivals();
        let Arrivals { folder: Some((folder, known)), waiting } = &mut *arrivals else { return };
        // a folder that cannot be listed at the moment is listed again soon
        let files = list(folder).map(|(files, _)| files).unwrap_or_default();
        for file in files.into_iter().filter(|file| growing.as_ref() != Some(&file.path)) {
            if known.insert(file.path.clone()) {
                waiting.push_back((file.path, true));
            }
        }
    }

    fn look_outside(self: &Arc<Self>) {
        let Some(bench) = self.bench().filter(|bench| bench.changed_outside()) else { return };
        let session = self.clone();
        let _ = self.jobs.start("reading the model file again", false, move |_| {
            bench.reload()?;
            session.hub.model();
            Ok(())
        });
    }
}
