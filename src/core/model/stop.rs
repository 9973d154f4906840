//! Computations that somebody may stop.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::model::error::ModelError;

thread_local! {
    static HEEDED: RefCell<Option<Stop>> = const { RefCell::new(None) };
}

/// Stops computations, from any thread, for good. Clones stop the same ones.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Makes simulations on this thread heed this: once it is stopped, they fail with [`ModelError::Stopped`].
    pub fn heed(&self) {
        HEEDED.set(Some(self.clone()));
    }

    /// So many threads, or one a core where the caller names no number, on which simulations heed this.
    ///
    /// # Errors
    /// If the system gives no threads.
    pub fn threads(&self, most: Option<usize>) -> Result<ThreadPool, ThreadPoolBuildError> {
        let stop = self.clone();
        ThreadPoolBuilder::new().num_threads(most.unwrap_or(0)).start_handler(move |_| stop.heed()).build()
    }

    /// Stops what heeds this.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it is stopped.
    pub fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// # Errors
    /// [`ModelError::Stopped`] once it is stopped.
    #[inline]
    pub fn check(&self) -> Result<(), ModelError> {
        if self.is_stopped() { Err(ModelError::Stopped) } else { Ok(()) }
    }
}

/// What a thread heeds, for a loop that looks often.
pub(crate) struct Heeded(Option<Stop>);

impl Heeded {
    pub(crate) fn by_this_thread() -> Heeded {
        Heeded(HEEDED.with_borrow(Clone::clone))
    }

    #[inline]
    pub(crate) fn check(&self) -> Result<(), ModelError> {
        self.0.as_ref().map_or(Ok(()), Stop::check)
    }
}

/// A search leaves out what cannot be simulated, so one that was stopped would end with what it happened to have. This
/// is its last word instead.
///
/// # Errors
/// [`ModelError::Stopped`] where this thread's computations are stopped.
pub fn check() -> Result<(), ModelError> {
    Heeded::by_this_thread().check()
}
