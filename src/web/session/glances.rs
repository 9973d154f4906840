//! Runs that are looked at without being opened for a fit: a sparkline in the table, a curve beside others.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use serde_json::{Value, json};

use crate::report::view::decimate;
use crate::results::fit_record::recorded_at;
use crate::study::Study;
use crate::study::models;

type AnyError = Box<dyn Error + Send + Sync>;

/// Most bytes of a file that is looked at beside others.
const MOST_BYTES: u64 = 256 << 20;
/// Samples of all recordings that are kept in memory for a comparison.
const MOST_SAMPLES: usize = 8_000_000;
/// Buckets of a sparkline; each shows its smallest and its largest head.
const BUCKETS: usize = 40;

/// A file as it was when it was read.
pub type FileKey = (PathBuf, u64, Option<SystemTime>);

/// See the module.
#[derive(Default)]
pub struct Glances {
    /// The latest last.
    kept: Mutex<Vec<(FileKey, Arc<Study>)>>,
    glances: Mutex<BTreeMap<FileKey, Value>>,
    /// One file is read at a time: a table of hundreds must not take the machine.
    reading: Mutex<()>,
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Samples of all recordings of a study.
pub fn samples(study: &Study) -> usize {
    study.runs().iter().flat_map(|run| &run.sensors).map(|s| s.time_s.len()).sum()
}

impl Glances {
    /// A recording, read and inspected; kept for the next time while it is not changed.
    ///
    /// # Errors
    /// One that cannot be read, shows no closure, or is too large to look at beside others.
    pub fn study(&self, path: &Path) -> Result<Arc<Study>, AnyError> {
        let key = key(path)?;
        if key.1 > MOST_BYTES {
            let most = MOST_BYTES >> 20;
            return Err(format!("{}: larger than {most} MB: open it alone", key.0.display()).into());
        }
        let known = || lock(&self.kept).iter().find(|(known, _)| *known == key).map(|(_, study)| study.clone());
        if let Some(study) = known() {
            return Ok(study);
        }
        let _one = lock(&self.reading);
        if let Some(study) = known() {
            return Ok(study);
        }
        let study = Arc::new(Study::open([path])?);
        let mut kept = lock(&self.kept);
        kept.push((key, study.clone()));
        while kept.len() > 1 && kept.iter().map(|(_, study)| samples(study)).sum::<usize>() > MOST_SAMPLES {
            kept.remove(0);
        }
        Ok(study)
    }

    /// What a row of the table shows of a run: a sparkline, what was measured, and the error of the model beside it.
    /// `error` says why a run cannot be read.
    pub fn glance(&self, path: &Path) -> Value {
        let seen = key(path).and_then(|key| {
            if let Some(known) = lock(&self.glances).get(&key) {
                return Ok(known.clone());
            }
            let glance = looked_at(&*self.study(path)?);
            lock(&self.glances).insert(key, glance.clone());
            Ok(glance)
        });
        let mut glance = seen.unwrap_or_else(|error| json!({ "error": error.to_string(), "spark": [] }));
        if let Ok(file) = models::load(&path.with_extension("model.toml")) {
            let model = file.current();
            glance["rmse_m"] = json!(model.rmse_m);
            glance["noise_m"] = json!(model.noise_m);
            glance["effects"] = json!(model.effects);
        }
        glance
    }
}

/// A file as it is now.
///
/// # Errors
/// One that is not there.
pub fn key(path: &Path) -> Result<FileKey, AnyError> {
    let about = std::fs::metadata(path)?;
    Ok((path.to_owned(), about.len(), about.modified().ok()))
}

fn looked_at(study: &Study) -> Value {
    let loaded = &study.recordings()[0];
    json!({
        "spark": study.runs()[0].sensors.last().map_or(Vec::new(), |sensor| spark(&sensor.head_m)),
        "rig": study.rig().name, "when": recorded_at(loaded.recording.run.start_unix_ns),
        "temperature_degC": loaded.measured_temperature_degc(),
        "flow_m3_s": loaded.features.flow_m3_s.map(|q| q.value),
        "faults": loaded.faults.iter().map(|fault| json!(fault)["says"].clone()).collect::<Vec<_>>(),
    })
}

/// So few heads that they fit a cell of a table; every peak is among them.
pub fn spark(head_m: &[f64]) -> Vec<f64> {
    decimate::keep(&[head_m], head_m.len(), BUCKETS).into_iter().map(|i| head_m[i]).filter(|h| h.is_finite()).collect()
}
