//! HDF5 files, those of MATLAB's `save -v7.3` among them: numeric datasets of one or two dimensions in any group.

use hdf5_reader::group::Group;
use hdf5_reader::{Dataset, Datatype, Hdf5File, OpenOptions};

use crate::storage::import::arrays::{Array, DEEPEST, MOST_ARRAYS, MOST_UNPACKED};
use crate::storage::import::tdms::bytes::Bytes;

/// The signature stands at the start, or behind what another program keeps there: MATLAB 512 bytes.
const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Attributes that hold a unit.
const UNITS: [&str; 4] = ["units", "unit", "Units", "Unit"];

/// Whether the bytes are those of an HDF5 file.
pub(crate) fn is_hdf5(bytes: &[u8]) -> bool {
    [0, 512].iter().any(|at| bytes.get(*at..).is_some_and(|rest| rest.starts_with(SIGNATURE)))
}

/// The numeric arrays of a file.
///
/// # Errors
/// A file that is damaged or cut off, or unpacks to more than it may.
pub(crate) fn read(bytes: &[u8]) -> Result<Vec<Array>, String> {
    let most = MOST_UNPACKED.saturating_mul(bytes.len());
    let options = OpenOptions::default().with_max_read_bytes(most).with_max_chunk_bytes(most);
    let file = Hdf5File::from_bytes_with_options(bytes, options).map_err(|e| e.to_string())?;
    let mut found = Found { arrays: Vec::new(), room: most };
    found.group(&file.root_group().map_err(|e| e.to_string())?, "", 0)?;
    Ok(found.arrays)
}

struct Found {
    arrays: Vec<Array>,
    /// Bytes that may still be unpacked.
    room: usize,
}

impl Found {
    fn group(&mut self, group: &Group, within: &str, depth: usize) -> Result<(), String> {
        let (groups, datasets) = group.members().map_err(|e| e.to_string())?;
        let named = |name: &str| if within.is_empty() { name.to_owned() } else { format!("{within}/{name}") };
        for dataset in &datasets {
            if self.arrays.len() >= MOST_ARRAYS {
                return Ok(());
            }
            self.dataset(dataset, named(dataset.name()))?;
        }
        // MATLAB keeps parts of other variables in '#refs#'.
        for inner in groups.iter().filter(|g| depth < DEEPEST && !g.name().starts_with('#')) {
            self.group(inner, &named(inner.name()), depth + 1)?;
        }
        Ok(())
    }

    fn dataset(&mut self, dataset: &Dataset, name: String) -> Result<(), String> {
        let Some((code, size)) = number(dataset.dtype()) else { return Ok(()) };
        let lengths: Vec<usize> = dataset.shape().iter().filter_map(|n| usize::try_from(*n).ok()).collect();
        let [slow, fast] = match lengths[..] {
            [length] => [1, length],
            [rows, columns] => [rows, columns],
            _ => return Ok(()),
        };
        let needs = slow.checked_mul(fast).and_then(|count| count.checked_mul(size)).filter(|n| *n < self.room);
        let needs = needs.ok_or_else(|| format!("'{name}' unpacks to more than {MOST_UNPACKED} times the file"))?;
        self.room -= needs;
        let bytes = dataset.read_native_bytes().map_err(|e| format!("'{name}' cannot be read: {e}"))?;
        let mut bytes = Bytes::new(&bytes, cfg!(target_endian = "big"));
        let values = (0..slow * fast).map(|_| bytes.number(code)).collect::<Result<Vec<f64>, String>>()?;
        let unit = UNITS.iter().find_map(|unit| dataset.attribute(unit).ok()?.read_string().ok());
        let unit = unit.map(|u| u.trim().to_owned()).filter(|u| !u.is_empty());
        self.arrays.push(Array::new(name, unit, [fast, slow], &values));
        Ok(())
    }
}

/// What [`Bytes::number`] calls a type of numbers, and their size.
fn number(kind: &Datatype) -> Option<(u32, usize)> {
    Some(match kind {
        Datatype::FixedPoint { size: 1, signed: true, .. } => (1, 1),
        Datatype::FixedPoint { size: 2, signed: true, .. } => (2, 2),
        Datatype::FixedPoint { size: 4, signed: true, .. } => (3, 4),
        Datatype::FixedPoint { size: 8, signed: true, .. } => (4, 8),
        Datatype::FixedPoint { size: 1, signed: false, .. } => (5, 1),
        Datatype::FixedPoint { size: 2, signed: false, .. } => (6, 2),
        Datatype::FixedPoint { size: 4, signed: false, .. } => (7, 4),
        Datatype::FixedPoint { size: 8, signed: false, .. } => (8, 8),
        Datatype::FloatingPoint { size: 4, .. } => (9, 4),
        Datatype::FloatingPoint { size: 8, .. } => (10, 8),
        _ => return None,
    })
}
