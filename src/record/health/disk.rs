//! How much room the disk has, and how fast the recording takes it.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::record::health::snapshot::Disk;

const LOOK_EVERY: Duration = Duration::from_secs(1);
/// Weight of the last second in the rate: chunks are written by the hundredth of a second, shots begin with a heap of
/// them.
const NEWEST: f64 = 0.3;

/// Looks at a growing file and its disk.
#[derive(Debug, Default)]
pub struct DiskWatch {
    file: PathBuf,
    /// Its length, and when it had it.
    length: Option<(u64, Instant)>,
    seen: Option<Disk>,
}

impl DiskWatch {
    /// The disk of a file that grows, or of a folder in which none does now.
    pub fn look(&mut self, place: &Path) -> Option<Disk> {
        let known = self.length.filter(|_| self.file == place);
        if known.is_some_and(|(_, at)| at.elapsed() < LOOK_EVERY) {
            return self.seen;
        }
        let length = place.metadata().ok().filter(|file| file.is_file()).map_or(0, |file| file.len());
        let rate = known.map(|(before, at)| length.saturating_sub(before) as f64 / at.elapsed().as_secs_f64());
        let old = self.seen.map(|disk| disk.bytes_per_s).filter(|rate| *rate > 0.0);
        let bytes_per_s = match (rate, old) {
            (Some(rate), Some(old)) if rate > 0.0 => NEWEST * rate + (1.0 - NEWEST) * old,
            (rate, _) => rate.unwrap_or(0.0),
        };
        self.length = Some((length, Instant::now()));
        self.file = place.to_owned();
        self.seen = free_bytes(place).map(|free_bytes| Disk { free_bytes, bytes_per_s });
        self.seen
    }
}

#[cfg(unix)]
fn free_bytes(place: &Path) -> Option<u64> {
    use nix::sys::statvfs::statvfs;
    let folder = place.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let room = statvfs(place).or_else(|_| statvfs(folder)).ok()?;
    Some((room.blocks_available() as u64).saturating_mul(room.fragment_size() as u64))
}

#[cfg(not(unix))]
fn free_bytes(_: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn a_growing_file_has_a_rate_and_its_disk_room() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("run.mcap");
        let mut watch = DiskWatch::default();
        // not there yet: the room is that of its folder
        let first = watch.look(&file).unwrap();
        assert!(first.free_bytes > 0 && first.lasts_s().is_infinite());
        watch.length = watch.length.map(|(length, at)| (length, at - 2 * LOOK_EVERY));
        std::fs::write(&file, vec![0; 1_000_000]).unwrap();
        let grown = watch.look(&file).unwrap();
        assert!((grown.bytes_per_s / 5e5 - 1.0).abs() < 0.05, "{grown:?}");
        let lasts_s = grown.free_bytes as f64 / grown.bytes_per_s;
        assert_eq!(grown.lasts_s(), lasts_s);
        assert_eq!(watch.look(&file), Some(grown), "it is looked at once a second");
        assert_eq!(watch.look(folder.path()).unwrap().bytes_per_s, 0.0);
    }
}
