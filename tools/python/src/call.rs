//! A computation on a thread of its own, so that Ctrl-C and a watcher of the progress are heard while it runs.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, RecvTimeoutError, TryRecvError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;
use surgescope::fit::progress::Progress as Heard;
use surgescope::model::stop::Stop;

use crate::error::{AnyError, fault, refused, sentence};

/// How often Ctrl-C and the progress are looked at: a person takes a tenth of a second for at once.
const LOOK_EVERY: Duration = Duration::from_millis(50);
/// The caller stays awake for so long.
const SHORT: Duration = Duration::from_micros(200);

/// How far a computation has come, as `progress=` hears it. Its text fits one line.
#[pyclass(frozen, module = "surgescope", get_all)]
pub struct Progress {
    /// All of it in a line.
    pub line: String,
    /// What is being done, in words.
    pub stage: String,
    /// Reaches of the grid of the fit at work; None where no model is being fitted.
    pub reaches: Option<usize>,
    /// Iteration of the fit within the stage.
    pub iteration: Option<usize>,
    /// Root mean square of the weighted residuals: 1 is the noise.
    pub error_over_noise: Option<f64>,
    /// Simulations done, of `simulate_many`.
    pub done: Option<usize>,
    /// Simulations to do, of `simulate_many`.
    pub total: Option<usize>,
}

#[pymethods]
impl Progress {
    fn __str__(&self) -> &str {
        &self.line
    }

    fn __repr__(&self) -> String {
        format!("<surgescope.Progress: {}>", self.line)
    }
}

impl From<Heard> for Progress {
    fn from(heard: Heard) -> Self {
        let at = heard.fitting;
        Progress {
            line: heard.to_string(),
            stage: heard.stage,
            reaches: at.map(|at| at.reaches),
            iteration: at.map(|at| at.iteration),
            error_over_noise: at.map(|at| at.error_over_noise),
            done: None,
            total: None,
        }
    }
}

impl Progress {
    /// Of so many simulations.
    pub fn counted(done: usize, total: usize) -> Self {
        Progress {
            done: Some(done),
            total: Some(total),
            ..Progress::from(Heard::from(format!("simulated {done} of {total}")))
        }
    }
}

/// The latest that a computation has told, until somebody takes it.
#[derive(Clone, Default)]
pub struct Told(Arc<Mutex<Option<Progress>>>);

impl Told {
    /// Tells how far it is.
    pub fn tell(&self, progress: Progress) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(progress);
    }

    fn take(&self) -> Option<Progress> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Runs `work` on all cores, or on so many `threads`, without holding the interpreter; `progress` is called on this
/// thread.
///
/// # Errors
/// Those of the work; KeyboardInterrupt, or what `progress` raises, and the work ends at its next time step.
pub fn on_all_cores<T: Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Told) -> Result<T, AnyError> + Send + 'static,
) -> PyResult<T> {
    if threads == Some(0) {
        return Err(sentence("threads must be 1 or more; leave it out for all cores"));
    }
    let stop = Stop::default();
    let heeding = stop.clone();
    started(py, stop, progress, move |told| {
        // Threads of its own, so that nothing else is stopped with it, and a forked process has all of them.
        heeding.threads(threads)?.install(|| work(told))
    })
}

/// Runs `work`, which needs one thread, as [`on_all_cores`] on several.
///
/// # Errors
/// As there.
pub fn on_one<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, AnyError> + Send + 'static,
) -> PyResult<T> {
    started(py, Stop::default(), None, |_| work())
}

fn started<T: Send + 'static>(
    py: Python<'_>,
    stop: Stop,
    progress: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Told) -> Result<T, AnyError> + Send + 'static,
) -> PyResult<T> {
    let told = Told::default();
    let (send, mut ended) = sync_channel(1);
    let (heeding, telling) = (stop.clone(), told.clone());
    let run = move || {
        heeding.heed();
        let result = catch_unwind(AssertUnwindSafe(|| work(&telling)));
        // Nobody receives it any more where the caller was interrupted.
        let _ = send.send(result);
    };
    thread::Builder::new().name("surgescope".into()).spawn(run)?;
    let result = loop {
        if let Some(result) = py.detach(|| next(&mut ended)) {
            break result;
        }
        let heard = py.check_signals().and_then(|()| match (progress, told.take()) {
            (Some(progress), Some(now)) => progress.call1((now,)).map(drop),
            _ => Ok(()),
        });
        if let Err(interrupted) = heard {
            stop.stop();
            return Err(interrupted);
        }
    };
    match result {
        Some(Ok(done)) => done.map_err(|error| refused(py, error.as_ref())),
        Some(Err(_)) | None => Err(fault()),
    }
}

/// What has come: nothing yet, the result, or that there will be none.
#[allow(clippy::type_complexity)] // the result of a thread
fn next<T>(
    ended: &mut Receiver<thread::Result<Result<T, AnyError>>>,
) -> Option<Option<thread::Result<Result<T, AnyError>>>> {
    // a short simulation ends before a sleeping thread would be awake again
    let begun = Instant::now();
    while begun.elapsed() < SHORT {
        match ended.try_recv() {
            Ok(result) => return Some(Some(result)),
            Err(TryRecvError::Empty) => thread::yield_now(),
            Err(TryRecvError::Disconnected) => return Some(None),
        }
    }
    match ended.recv_timeout(LOOK_EVERY) {
        Ok(result) => Some(Some(result)),
        Err(RecvTimeoutError::Timeout) => None,
        Err(RecvTimeoutError::Disconnected) => Some(None),
    }
}
