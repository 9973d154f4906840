//! MAT files of version 5, which MATLAB's `save` writes up to `-v7`, and so do Octave, SciPy and simulation programs.
//!
//! MathWorks, *MAT-File Format* (2019): after a header of 128 bytes come elements, each with a type and a length; a
//! matrix is an element of elements, and may be compressed. Real numeric arrays are read, also in structures and cells,
//! and single texts; what else there is, is named.

use std::io::Read as _;

use flate2::read::ZlibDecoder;

use crate::storage::import::arrays::contents::{Array, Contents, DEEPEST, MOST_ARRAYS, MOST_UNPACKED, too_many};
use crate::storage::import::tdms::bytes::Bytes;

const HEADER: usize = 128;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;
/// Classes of matrices.
const CELL: u32 = 1;
const STRUCTURE: u32 = 2;
const OBJECT: u32 = 3;
const TEXT: u32 = 4;
const SPARSE: u32 = 5;
const FUNCTION: u32 = 16;
const OPAQUE: u32 = 17;
/// A flag beside the class.
const COMPLEX: u32 = 0x800;
const NUMERIC: std::ops::RangeInclusive<u32> = 6..=15;

/// How such a file begins; those of version 4 begin with nothing that tells them.
pub(crate) fn is_mat(bytes: &[u8]) -> bool {
    bytes.len() > HEADER && bytes.starts_with(b"MATLAB 5.0") && matches!(&bytes[126..128], b"IM" | b"MI")
}

/// What a file holds.
///
/// # Errors
/// A file that is damaged or cut off, or unpacks to more than it may.
pub(crate) fn read(bytes: &[u8]) -> Result<Contents, String> {
    let big_endian = &bytes[126..128] == b"MI";
    let mut file = Bytes::new(&bytes[HEADER..], big_endian);
    let mut found = Contents::default();
    let mut room = MOST_UNPACKED.saturating_mul(bytes.len()) as u64;
    while file.len() > 8 {
        let (kind, body) = element(&mut file)?;
        if kind == COMPRESSED {
            let mut plain = Vec::new();
            let unpacked = ZlibDecoder::new(body).take(room).read_to_end(&mut plain);
            unpacked.map_err(|e| format!("a variable cannot be unpacked ({e}): the file is damaged or cut off"))?;
            room -= plain.len() as u64;
            if room == 0 {
                return Err(format!("it unpacks to more than {MOST_UNPACKED} times its size"));
            }
            let (kind, body) = element(&mut Bytes::new(&plain, big_endian))?;
            matrix(kind, Bytes::new(body, big_endian), "", 0, &mut found)?;
        } else {
            matrix(kind, Bytes::new(body, big_endian), "", 0, &mut found)?;
        }
    }
    Ok(found)
}

/// Type and body of the next element, which is filled up to eight bytes unless it is compressed; short ones stand
/// within their tag.
fn element<'b>(file: &mut Bytes<'b>) -> Result<(u32, &'b [u8]), String> {
    let tag = file.u32()?;
    if tag >> 16 != 0 {
        let short = file.take(4)?;
        return Ok((tag & 0xffff, short.get(..(tag >> 16) as usize).ok_or("the length of an element is wrong")?));
    }
    let length = file.u32()? as usize;
    let body = file.take(length)?;
    let fill = if tag == COMPRESSED { 0 } else { length.wrapping_neg() % 8 };
    file.take(fill.min(file.len()))?;
    Ok((tag, body))
}

/// Adds the array that an element is, or the fields of a structure and the cells of a cell array.
fn matrix(kind: u32, mut body: Bytes, name: &str, depth: usize, found: &mut Contents) -> Result<(), String> {
    if kind != MATRIX || body.len() == 0 || depth > DEEPEST {
        return Ok(());
    }
    if found.arrays.len() + found.texts.len() >= MOST_ARRAYS {
        return Err(too_many());
    }
    let big_endian = body.is_big_endian();
    let flags = Bytes::new(element(&mut body)?.1, big_endian).u32()?;
    let class = flags & 0xff;
    let text = |body: &mut Bytes| Ok::<_, String>(String::from_utf8_lossy(element(body)?.1).into_owned());
    if class == OPAQUE {
        let own = text(&mut body)?;
        let name = if name.is_empty() { own } else { name.to_owned() };
        found.unread.push((name, "an object of MATLAB".into()));
        return Ok(());
    }
    let mut sizes = Bytes::new(element(&mut body)?.1, big_endian);
    let [rows, columns, further] = [sizes.u32()? as usize, sizes.u32()? as usize, sizes.len()];
    let own = text(&mut body)?;
    let name = if name.is_empty() { own } else { name.to_owned() };
    // MATLAB keeps the insides of objects in a variable without a name
    if name.is_empty() {
        return Ok(());
    }
    let count = rows.saturating_mul(columns);
    let kind = match class {
        STRUCTURE if further == 0 => {
            let width = Bytes::new(element(&mut body)?.1, big_endian).u32()? as usize;
            let names = element(&mut body)?.1;
            for i in 0..count.min(MOST_ARRAYS) {
                let within = if count == 1 { name.clone() } else { format!("{name}({})", i + 1) };
                for field in names.chunks(width.max(1)).take(MOST_ARRAYS) {
                    let field = String::from_utf8_lossy(field.split(|b| *b == 0).next().unwrap_or_default());
                    let (kind, value) = element(&mut body)?;
                    matrix(kind, Bytes::new(value, big_endian), &format!("{within}/{field}"), depth + 1, found)?;
                }
            }
            return Ok(());
        }
        CELL if further == 0 => {
            for i in 0..count.min(MOST_ARRAYS) {
                let (kind, value) = element(&mut body)?;
                matrix(kind, Bytes::new(value, big_endian), &format!("{name}{{{}}}", i + 1), depth + 1, found)?;
            }
            return Ok(());
        }
        TEXT if rows <= 1 && further == 0 => {
            let (kind, characters) = element(&mut body)?;
            found.texts.push((name, characters_of(kind, Bytes::new(characters, big_endian))));
            return Ok(());
        }
        class if NUMERIC.contains(&class) && flags & COMPLEX != 0 => "complex numbers",
        class if NUMERIC.contains(&class) && further == 0 => {
            let (kind, numbers) = element(&mut body)?;
            let (code, size) =
                number(kind).ok_or_else(|| format!("'{name}' holds numbers of the unknown type {kind}"))?;
            if count.checked_mul(size) != Some(numbers.len()) {
                return Err(format!("'{name}' has another size than its numbers: the file is damaged"));
            }
            let mut bytes = Bytes::new(numbers, big_endian);
            let values = (0..count).map(|_| bytes.number(code)).collect::<Result<Vec<f64>, String>>()?;
            found.arrays.push(Array::new(name, [rows, columns], &values));
            return Ok(());
        }
        TEXT => "lines of text",
        SPARSE => "a sparse matrix",
        OBJECT => "an object of MATLAB",
        FUNCTION => return Ok(()),
        _ => "more than two dimensions",
    };
    found.unread.push((name, kind.into()));
    Ok(())
}

/// Text in UTF-16, or one byte a character.
fn characters_of(kind: u32, mut bytes: Bytes) -> String {
    const UTF16: [u32; 2] = [4, 17];
    let mut units = Vec::new();
    while UTF16.contains(&kind)
        && let Ok(unit) = bytes.number(6)
    {
        units.push(unit as u16);
    }
    match bytes.take(bytes.len()) {
        Ok(rest) if !UTF16.contains(&kind) => String::from_utf8_lossy(rest).into_owned(),
        _ => String::from_utf16_lossy(&units),
    }
}

/// What [`Bytes::number`] calls a type of numbers, and their size.
fn number(kind: u32) -> Option<(u32, usize)> {
    Some(match kind {
        1 => (1, 1),
        2 => (5, 1),
        3 => (2, 2),
        4 => (6, 2),
        5 => (3, 4),
        6 => (7, 4),
        7 => (9, 4),
        9 => (10, 8),
        12 => (4, 8),
        13 => (8, 8),
        _ => return None,
    })
}
