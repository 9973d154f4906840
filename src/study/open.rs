//! Recordings from disk with their signals, ready for a fit.

use std::path::{Path, PathBuf};

use crate::fit::data::prepare::prepare;
use crate::fit::data::run_data::RunData;
use crate::model::own::of_rig;
use crate::recording::Recording;
use crate::rig::{Rig, SensorKind};
use crate::shown::Shown as _;
use crate::signal::Features;
use crate::signal::doubts::doubts;
use crate::signal::faults::{SensorFault, examine, in_words};
use crate::signal::window::Window;
use crate::storage::output::{same_content, same_file};
use crate::study::error::{Error, Result};

/// A recording with what it shows.
pub struct Loaded {
    /// File name without its folder.
    pub file: String,
    /// The recording, on the rig in force; of a long one the part that is used.
    pub recording: Recording,
    /// What it shows.
    pub features: Features,
    /// What of that should make a user look twice, one sentence each.
    pub doubts: Vec<String>,
    /// Sensors whose records no physics explains.
    pub faults: Vec<SensorFault>,
    /// What of a long recording is used.
    pub window: Option<Window>,
}

impl Loaded {
    /// Inspects a recording; `file` is its name in tables and messages.
    ///
    /// # Errors
    /// No pressure, or no closure.
    pub fn new(file: String, recording: Recording) -> Result<Loaded> {
        Ok(Loaded::with_whole(file, recording)?.0)
    }

    /// Temperature of the water, °C, where a sensor read it and it is not the rig file's.
    pub fn measured_temperature_degc(&self) -> Option<f64> {
        let mut sensors = self.recording.rig.sensors.iter().zip(&self.recording.series);
        let reads = sensors.any(|(s, series)| s.kind == SensorKind::Temperature && !series.value.is_empty());
        reads.then_some(self.features.temperature_degc)
    }

    /// The same, and the recording as it was where only a part of it is used.
    fn with_whole(file: String, recording: Recording) -> Result<(Loaded, Option<Recording>)> {
        of_rig(&recording.rig)?;
        let file = file.shown().into_owned();
        let window = Window::of(&recording);
        let (recording, whole) = match window {
            Some(window) => (window.cut(&recording), Some(recording)),
            None => (recording, None),
        };
        let (features, faults) = examine(&recording);
        let features = match features {
            Ok(features) => features,
            Err(source) => {
                // that only a part was looked at may be why
                let file = window.map_or(file.clone(), |window| format!("{file} ({})", window.in_words()));
                return Err(match faults.iter().any(SensorFault::forbids_a_fit) {
                    true => Error::Faulty { file, faults, source: Some(source) },
                    false => Error::Unusable { file, source },
                });
            }
        };
        let mut doubts = doubts(&recording.rig, &features);
        doubts.extend(window.map(|window| window.in_words()));
        doubts.extend((!faults.is_empty()).then(|| in_words(&faults)));
        Ok((Loaded { file, recording, features, doubts, faults, window }, whole))
    }

    /// Refuses a recording with a faulty sensor: in a diagnosis an effect would only stand in for the fault.
    ///
    /// # Errors
    /// [`Error::Faulty`].
    pub fn require_sound(&self) -> Result<()> {
        if !self.faults.iter().any(SensorFault::forbids_a_fit) {
            return Ok(());
        }
        Err(Error::Faulty { file: self.file.clone(), faults: self.faults.clone(), source: None })
    }

    /// What a fit takes.
    pub fn run(&self) -> RunData {
        prepare(&self.file, &self.recording.rig, &self.recording, &self.features)
    }
}

/// Reads recordings, all of one rig: that of `rig`, or the one stored in the first of them; `ignored` sensors are left
/// out.
///
/// # Errors
/// Any that cannot be read or shows no closure (the file is named), one given twice, or recordings of different rigs.
pub fn load(paths: &[PathBuf], rig: Option<&Path>, ignored: &[String]) -> Result<Vec<Loaded>> {
    load_keeping(paths, rig, ignored, drop)
}

/// The same; `whole` takes each recording as it was, where only a part of it is used.
///
/// # Errors
/// As [`load`].
pub(crate) fn load_keeping(
    paths: &[PathBuf],
    rig: Option<&Path>,
    ignored: &[String],
    mut whole: impl FnMut(Option<Recording>),
) -> Result<Vec<Loaded>> {
    let given = rig.map(Rig::load).transpose()?;
    let mut loaded: Vec<Loaded> = Vec::new();
    for (i, path) in paths.iter().enumerate() {
        if let Some(twin) = paths[..i].iter().find(|p| same_file(p, path)) {
            return Err(if twin == path {
                Error::Twice(path.clone())
            } else {
                Error::SameFile { one: twin.clone(), other: path.clone() }
            });
        }
        if let Some(twin) = paths[..i].iter().find(|p| same_content(p, path)) {
            return Err(Error::Copy { copy: path.clone(), original: twin.clone() });
        }
        let mut recording = crate::storage::read(path)?;
        let shown = path.shown().into_owned();
        if let Some(rig) = &given {
            recording =
                recording.on_rig(rig.clone()).map_err(|source| Error::Mismatch { file: shown.clone(), source })?;
        } else if let Some(first) = loaded.first() {
            one_rig((&first.file, &first.recording.rig), (&shown, &recording.rig))?;
        }
        recording = recording.without(ignored).map_err(|source| Error::Mismatch { file: shown.clone(), source })?;
        let (mut one, recorded) = Loaded::with_whole(shown, recording)?;
        whole(recorded);
        one.file = file_name(path, paths);
        loaded.push(one);
    }
    Ok(loaded)
}

/// Refuses recordings of two rigs, each given with the file's name.
///
/// # Errors
/// Rigs that were not read from the same text.
pub(crate) fn one_rig((first, first_rig): (&str, &Rig), (other, other_rig): (&str, &Rig)) -> Result<()> {
    if first_rig.source == other_rig.source && first_rig.own_effects == other_rig.own_effects {
        return Ok(());
    }
    Err(Error::SeveralRigs {
        first: first.to_owned(),
        first_rig: first_rig.name.clone(),
        other: other.to_owned(),
        other_rig: other_rig.name.clone(),
    })
}

/// The file's name alone, or its path where another of the paths has the same name.
fn file_name(path: &Path, paths: &[PathBuf]) -> String {
    let name = path.file_name().unwrap_or(path.as_os_str());
    let unique = paths.iter().filter(|p| p.file_name() == Some(name)).count() == 1;
    if unique { name.to_string_lossy().shown().into_owned() } else { path.shown().into_owned() }
}
