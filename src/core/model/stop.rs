//! Computations that somebody may stop.

use std::cell::RefCell;
use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    static STOP: RefCell<Option<Arc<AtomicBool>>> = const { RefCell::new(None) };
}

/// What a computation unwinds with when somebody stops it.
pub struct Stopped;

/// Makes computations on this thread unwind with [`Stopped`], at the next time step that a model takes, once `stop` is
/// set. Whoever starts them catches it.
pub fn heed(stop: Arc<AtomicBool>) {
    STOP.set(Some(stop));
}

/// Unwinds if somebody stops this thread's computations.
pub fn stop_if_told() {
    Heeded::by_this_thread().stop_if_told();
}

/// What the computations of a thread heed, for a loop that looks often.
pub(crate) struct Heeded(Option<Arc<AtomicBool>>);

impl Heeded {
    pub(crate) fn by_this_thread() -> Heeded {
        Heeded(STOP.with_borrow(Clone::clone))
    }

    #[inline]
    pub(crate) fn stop_if_told(&self) {
        if self.0.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
            resume_unwind(Box::new(Stopped));
        }
    }
}
