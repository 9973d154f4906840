//! One job at a time: it tells how far it has come, and can be cancelled.

use std::error::Error;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use serde_json::json;

use crate::fit::progress::{Passing, Progress};
use crate::model::stop::Stop;
use crate::watch::evaluate::sentence;
use crate::web::session::events::Hub;

/// Errors of a job that are kept for a page that comes later.
const KEPT: usize = 2000;

type AnyError = Box<dyn Error + Send + Sync>;

/// Why no job was started.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)] // the sentences say it
pub enum Busy {
    #[error("the workbench is busy: {0}; wait for its end or cancel it")]
    AtWork(String),
    #[error("nothing is open: open a run first")]
    Nothing,
}

/// The job at work.
#[derive(Debug, Clone)]
pub struct Job {
    /// Its number.
    pub id: u64,
    /// What it does, in words.
    pub what: String,
    /// The latest that it said.
    pub progress: String,
    /// Iterations of fits so far, and the error after each, m.
    pub errors: Vec<(usize, f64)>,
    /// The model as it is at this moment, where one is being fitted.
    pub passing: Option<Arc<Passing>>,
    opens: bool,
    stop: Stop,
}

#[derive(Default)]
struct State {
    last: u64,
    job: Option<Job>,
    failed: Option<String>,
    iterations: usize,
    /// Noise that errors are multiples of, m.
    noise_m: f64,
}

/// See the module.
pub struct Jobs {
    state: Mutex<State>,
    ended: Condvar,
    hub: Arc<Hub>,
}

impl Jobs {
    /// None at work; `hub` hears of each.
    pub fn new(hub: Arc<Hub>) -> Jobs {
        Jobs { state: Mutex::new(State::default()), ended: Condvar::new(), hub }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The job at work.
    pub fn current(&self) -> Option<Job> {
        self.lock().job.clone()
    }

    /// Why the last job failed; none where it did not, or was cancelled.
    pub fn failed(&self) -> Option<String> {
        self.lock().failed.clone()
    }

    /// Whether there is one.
    pub fn at_work(&self) -> bool {
        self.lock().job.is_some()
    }

    /// Sets the noise of what is fitted, m.
    pub fn set_noise_m(&self, noise_m: f64) {
        self.lock().noise_m = noise_m;
    }

    /// Starts a job on a thread of its own. The job reports its end, and why it failed.
    ///
    /// # Errors
    /// If one is at work.
    pub fn start(
        self: &Arc<Self>,
        what: &str,
        opens: bool,
        work: impl FnOnce(&Arc<Jobs>) -> Result<(), AnyError> + Send + 'static,
    ) -> Result<u64, Busy> {
        let stop = Stop::default();
        let id = {
            let mut state = self.lock();
            if let Some(job) = &state.job {
                return Err(Busy::AtWork(job.what.clone()));
            }
            state.last += 1;
            state.failed = None;
            state.iterations = 0;
            let (what, progress) = (what.to_owned(), String::new());
            let stop = stop.clone();
            state.job = Some(Job { id: state.last, what, progress, errors: Vec::new(), passing: None, opens, stop });
            state.last
        };
        self.hub.changed();
        let jobs = self.clone();
        std::thread::spawn(move || {
            // threads of its own, so that what is computed for pages meanwhile is not stopped with it
            let threads = stop.threads(None);
            let ended = catch_unwind(AssertUnwindSafe(|| threads?.install(|| work(&jobs))));
            let cancelled = stop.is_stopped() && matches!(ended, Ok(Err(_)));
            let message = match ended {
                Ok(Ok(())) => None,
                Ok(Err(_)) if cancelled => Some("cancelled".to_owned()),
                Ok(Err(error)) => Some(sentence(error.as_ref())),
                Err(_) => Some("this failed by a fault of the program; nothing was changed".to_owned()),
            };
            let mut state = jobs.lock();
            state.job = None;
            state.failed = message.clone().filter(|_| !cancelled);
            drop(state);
            jobs.ended.notify_all();
            match message {
                None => jobs.hub.send("done", &json!({ "job": id })),
                Some(message) => jobs.hub.send("failed", &json!({ "job": id, "message": message })),
            }
        });
        Ok(id)
    }

    /// Cancels the job at work: it ends when it next runs a model.
    pub fn cancel(&self) -> Option<u64> {
        let mut state = self.lock();
        let job = state.job.as_mut()?;
        job.stop.stop();
        "cancelling".clone_into(&mut job.progress);
        Some(job.id)
    }

    /// Hears from a computation.
    pub fn hear(&self, progress: &Progress) {
        let mut state = self.lock();
        let noise_m = state.noise_m;
        let counted = state.iterations + usize::from(progress.fitting.is_some());
        state.iterations = counted;
        let Some(job) = state.job.as_mut() else { return };
        job.progress = progress.to_string();
        job.passing = progress.passing.clone().or(job.passing.take());
        let rmse_m = progress.fitting.map(|at| at.error_over_noise * noise_m).filter(|e| e.is_finite());
        if let Some(rmse_m) = rmse_m.filter(|_| job.errors.len() < KEPT) {
            job.errors.push((counted, rmse_m));
        }
        let told = json!({
            "job": job.id, "what": job.what, "iteration": counted, "rmse_m": rmse_m, "progress": job.progress,
            "moves": progress.passing.is_some(),
        });
        drop(state);
        self.hub.send("progress", &told);
    }

    /// Waits until no job is at work, at most for some time; false where one still is.
    pub fn wait(&self, most: Duration) -> bool {
        self.wait_while(most, |job| job.is_some())
    }

    /// Waits until nothing is being opened.
    pub fn wait_for_opening(&self, most: Duration) -> bool {
        self.wait_while(most, |job| job.is_some_and(|job| job.opens))
    }

    fn wait_while(&self, most: Duration, waits: impl Fn(Option<&Job>) -> bool) -> bool {
        let until = Instant::now() + most;
        let mut state = self.lock();
        while waits(state.job.as_ref()) {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            state = self.ended.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LONG: Duration = Duration::from_secs(20);

    fn block_on<T>(future: impl Future<Output = T>) -> T {
        tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap().block_on(future)
    }

    #[test]
    fn one_job_at_a_time_and_its_end_is_told() {
        let hub = Arc::new(Hub::default());
        let mut heard = hub.listen();
        let jobs = Arc::new(Jobs::new(hub));
        let (go, wait) = std::sync::mpsc::channel::<()>();
        let first = jobs
            .start("first", false, move |jobs| {
                jobs.set_noise_m(0.5);
                jobs.hear(&Progress::fitting("fine", 32, 1, 4.0));
                wait.recv()?;
                Ok(())
            })
            .unwrap();
        assert_eq!(jobs.start("second", false, |_| Ok(())), Err(Busy::AtWork("first".into())));
        go.send(()).unwrap();
        assert!(jobs.wait(LONG));
        let failing = jobs.start("third", false, |_| Err("no water".into())).unwrap();
        assert!(jobs.wait(LONG));
        let mut said = Vec::new();
        while said.len() < 5 {
            let event = block_on(heard.next()).unwrap();
            said.push((event.name, serde_json::from_str::<serde_json::Value>(event.data.as_deref().unwrap()).unwrap()));
        }
        let of = |name: &str| said.iter().find(|(n, _)| *n == name).map(|(_, data)| data.clone()).unwrap();
        assert_eq!(of("progress")["rmse_m"], 2.0);
        assert_eq!(of("done")["job"], first);
        assert_eq!(of("failed")["job"], failing);
        assert_eq!(of("failed")["message"], "no water");
        assert_eq!(jobs.failed().as_deref(), Some("no water"), "who comes later hears it, too");
    }

    #[test]
    fn a_cancelled_job_ends_also_on_other_threads() {
        use crate::model::ModelError;
        use crate::model::stop::check;
        use rayon::prelude::*;
        let hub = Arc::new(Hub::default());
        let mut heard = hub.listen();
        let jobs = Arc::new(Jobs::new(hub));
        let (begun, wait) = std::sync::mpsc::channel::<()>();
        jobs.start("endless", false, move |jobs| {
            begun.send(())?;
            let one = |_| -> Result<(), ModelError> {
                loop {
                    check()?;
                    jobs.hear(&Progress::from("going on"));
                    std::thread::sleep(Duration::from_millis(1));
                }
            };
            Ok((0..4).into_par_iter().try_for_each(one)?)
        })
        .unwrap();
        wait.recv().unwrap();
        assert!(!jobs.wait(Duration::from_millis(20)) && jobs.cancel().is_some());
        assert!(jobs.wait(LONG) && jobs.cancel().is_none() && jobs.failed().is_none());
        let failed = std::iter::from_fn(|| block_on(heard.next())).find(|event| event.name == "failed").unwrap();
        assert!(failed.data.as_ref().unwrap().contains("cancelled"), "{failed:?}");
    }
}
