//! What is open, and what was open before, as it was left: whoever comes back finds the models and the diagnosis that
//! were not saved.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::web::session::bench::Bench;
use crate::web::session::glances::samples;

/// Samples of all that was left; what was left longest ago is given up first.
const MOST_SAMPLES: usize = 1_000_000;

/// See the module.
#[derive(Default)]
pub struct Benches {
    /// What is open comes last.
    all: Mutex<Vec<Arc<Bench>>>,
}

impl Benches {
    fn lock(&self) -> MutexGuard<'_, Vec<Arc<Bench>>> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What is open.
    pub fn open(&self) -> Option<Arc<Bench>> {
        self.lock().last().cloned()
    }

    /// What was left of these recordings, where their files are as they were.
    pub fn left(&self, paths: &[PathBuf]) -> Option<Arc<Bench>> {
        let found = self.lock().iter().find(|bench| bench.paths == paths).cloned();
        found.filter(|bench| bench.is_as_read())
    }

    /// The latest with this recording, open or left.
    pub fn with(&self, path: &Path) -> Option<Arc<Bench>> {
        let all = self.lock();
        let latest = all.iter().rposition(|bench| bench.paths.iter().any(|own| own == path))?;
        let (found, is_open) = (all[latest].clone(), latest + 1 == all.len());
        drop(all);
        Some(found).filter(|bench| is_open || bench.is_as_read())
    }

    /// Puts a bench in front; the one before it is left.
    pub fn put(&self, bench: Arc<Bench>) {
        let mut all = self.lock();
        all.retain(|other| other.paths != bench.paths);
        while all.iter().map(|left| samples(&left.study)).sum::<usize>() > MOST_SAMPLES {
            all.remove(0);
        }
        all.push(bench);
    }
}
