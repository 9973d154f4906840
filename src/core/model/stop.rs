//! Computations that somebody may stop.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

use crate::model::error::ModelError;

thread_local! {
    static HEEDED: RefCell<Stop> = RefCell::default();
}

/// Stops computations, from any thread, for good. Clones stop the same ones.
#[derive(Debug, Clone, Default)]
pub struct Stop(Arc<AtomicBool>);

impl Stop {
    /// Makes simulations on this thread heed this: once it is stopped, they fail with [`ModelError::Stopped`].
    pub fn heed(&self) {
        HEEDED.set(self.clone());
    }

    /// So many threads, or one a core where none is said, on which simulations heed this.
    ///
    /// # Errors
    /// If the system gives no threads.
    pub fn threads(&self, most: Option<usize>) -> Result<ThreadPool, ThreadPoolBuildError> {
        let stop = self.clone();
        ThreadPoolBuilder::new().num_threads(most.unwrap_or(0)).start_handler(move |_| stop.heed()).build()
    }

    /// What this thread heeds.
    pub(crate) fn heeded() -> Stop {
        HEEDED.with_borrow(Clone::clone)
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

/// A search leaves out what cannot be simulated, so one that was stopped would end with what it happened to have. This
/// is its last word instead.
///
/// # Errors
/// [`ModelError::Stopped`] where this thread's computations are stopped.
pub fn check() -> Result<(), ModelError> {
    Stop::heeded().check()
}
