//! HDF5 files, those of MATLAB's `save -v7.3` among them: numeric datasets of one or two dimensions in any group, the
//! fields of tables that are one dataset, and attributes. An attribute is a name behind that of what it belongs to.

use hdf5_reader::group::Group;
use hdf5_reader::{Attribute, Dataset, Datatype, Hdf5File, OpenOptions};

use crate::storage::import::arrays::contents::{Array, Contents, DEEPEST, MOST_ARRAYS, MOST_UNPACKED, too_many};
use crate::storage::import::tdms::bytes::Bytes;

/// The signature stands at the start, or behind what another program keeps there: MATLAB 512 bytes.
const SIGNATURE: &[u8] = b"\x89HDF\r\n\x1a\n";
/// Classes of MATLAB whose datasets are numbers.
const NUMERIC: [&str; 11] =
    ["double", "single", "int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "logical"];

/// Whether the bytes are those of an HDF5 file.
pub(crate) fn is_hdf5(bytes: &[u8]) -> bool {
    [0, 512].iter().any(|at| bytes.get(*at..).is_some_and(|rest| rest.starts_with(SIGNATURE)))
}

/// What a file holds.
///
/// # Errors
/// A file that is damaged or cut off, or unpacks to more than it may.
pub(crate) fn read(bytes: &[u8]) -> Result<Contents, String> {
    let most = MOST_UNPACKED.saturating_mul(bytes.len());
    let options = OpenOptions::default().with_max_read_bytes(most).with_max_chunk_bytes(most);
    let file = Hdf5File::from_bytes_with_options(bytes, options).map_err(|e| e.to_string())?;
    let mut found = Found { contents: Contents::default(), room: most };
    found.group(&file.root_group().map_err(|e| e.to_string())?, "", 0)?;
    Ok(found.contents)
}

struct Found {
    contents: Contents,
    /// Bytes that may still be unpacked.
    room: usize,
}

impl Found {
    fn group(&mut self, group: &Group, within: &str, depth: usize) -> Result<(), String> {
        let (groups, datasets) = group.members().map_err(|e| e.to_string())?;
        let named = |name: &str| if within.is_empty() { name.to_owned() } else { format!("{within}/{name}") };
        for attribute in group.attributes().unwrap_or_default() {
            self.attribute(&attribute, named(&attribute.name));
        }
        for dataset in &datasets {
            if self.contents.arrays.len() >= MOST_ARRAYS {
                return Err(too_many());
            }
            self.dataset(dataset, named(dataset.name()))?;
        }
        // MATLAB keeps parts of other variables in '#refs#'.
        for inner in groups.iter().filter(|g| depth < DEEPEST && !g.name().starts_with('#')) {
            self.group(inner, &named(inner.name()), depth + 1)?;
        }
        Ok(())
    }

    /// A number or a text; others say nothing of a test.
    fn attribute(&mut self, attribute: &Attribute, name: String) {
        if attribute.num_elements().is_ok_and(|count| count == 1) {
            if let Ok(text) = attribute.read_string() {
                self.contents.texts.push((name, text));
            } else if let Ok(number) = attribute.read_as_f64() {
                self.contents.arrays.push(Array::new(name, [1, 1], &[number]));
            }
        }
    }

    fn dataset(&mut self, dataset: &Dataset, name: String) -> Result<(), String> {
        let attributes = dataset.attributes();
        let text = |wanted: &str| attributes.iter().find(|a| a.name == wanted).and_then(|a| a.read_string().ok());
        let class = text("MATLAB_class");
        for attribute in &attributes {
            self.attribute(attribute, format!("{name}/{}", attribute.name));
        }
        let lengths: Vec<usize> = dataset.shape().iter().filter_map(|n| usize::try_from(*n).ok()).collect();
        let count = lengths.iter().try_fold(1usize, |product, n| product.checked_mul(*n)).unwrap_or(usize::MAX);
        if count == 0 || attributes.iter().any(|a| a.name == "MATLAB_empty") {
            return Ok(());
        }
        let shape = match lengths[..] {
            [] => Some([1, 1]),
            [length] => Some([1, length]),
            [rows, columns] => Some([rows, columns]),
            _ => None,
        };
        let fields = match dataset.dtype() {
            Datatype::Compound { fields, .. } => {
                fields.iter().map(|f| (Some(f.name.as_str()), f.byte_offset as usize, &f.datatype)).collect()
            }
            one => vec![(None, 0, one)],
        };
        let is_text = class.as_deref() == Some("char");
        let is_foreign = class.as_ref().is_some_and(|class| !is_text && !NUMERIC.contains(&class.as_str()));
        let unread = match (dataset.dtype(), &class) {
            (_, Some(class)) if is_foreign => format!("of MATLAB's class {class}"),
            (Datatype::String { .. } | Datatype::VarLen { .. }, _) => match dataset.read_string() {
                Ok(text) => {
                    self.contents.texts.push((name, text));
                    return Ok(());
                }
                Err(_) => format!("{count} texts or lists"),
            },
            _ if shape.is_none() => format!("{} dimensions", lengths.len()),
            _ if fields.iter().all(|(.., kind)| number(kind).is_none()) => "no numbers".to_owned(),
            _ => String::new(),
        };
        let Some([slow, fast]) = shape.filter(|_| unread.is_empty()) else {
            self.contents.unread.push((name, unread));
            return Ok(());
        };
        let size = dataset.raw_element_size().map_err(|e| e.to_string())?;
        let needs = count.checked_mul(size + fields.len()).filter(|n| *n < self.room);
        let needs = needs.ok_or_else(|| format!("'{name}' unpacks to more than {MOST_UNPACKED} times the file"))?;
        self.room -= needs;
        let bytes = dataset.read_native_bytes().map_err(|e| format!("'{name}' cannot be read: {e}"))?;
        for (field, offset, kind) in fields {
            let own = field.map_or_else(|| name.clone(), |field| format!("{name}/{field}"));
            let Some((code, _)) = number(kind) else {
                self.contents.unread.push((own, "no numbers".into()));
                continue;
            };
            let at = |i: usize| bytes.get(i * size + offset..).ok_or("a dataset is shorter than it says");
            let one = |i: usize| Bytes::new(at(i)?, cfg!(target_endian = "big")).number(code);
            let values = (0..count).map(one).collect::<Result<Vec<f64>, String>>()?;
            if is_text {
                let units: Vec<u16> = values.iter().map(|v| *v as u16).collect();
                self.contents.texts.push((own, String::from_utf16_lossy(&units)));
            } else {
                self.contents.arrays.push(Array::new(own, [fast, slow], &values));
            }
        }
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
