//! A table as a stream of Arrow's C interface: one batch. The structures are those of the specification,
//! <https://arrow.apache.org/docs/format/CDataInterface.html> and
//! <https://arrow.apache.org/docs/format/CStreamInterface.html>.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::{null, null_mut};

use pyo3::prelude::*;
use pyo3::types::PyCapsule;

use crate::table::{Table, Values};

const NULLABLE: i64 = 2;

#[repr(C)]
struct Schema {
    format: *const c_char,
    name: *const c_char,
    metadata: *const c_char,
    flags: i64,
    n_children: i64,
    children: *mut *mut Schema,
    dictionary: *mut Schema,
    release: Option<unsafe extern "C" fn(*mut Schema)>,
    private_data: *mut c_void,
}

#[repr(C)]
struct Array {
    length: i64,
    null_count: i64,
    offset: i64,
    n_buffers: i64,
    n_children: i64,
    buffers: *mut *const c_void,
    children: *mut *mut Array,
    dictionary: *mut Array,
    release: Option<unsafe extern "C" fn(*mut Array)>,
    private_data: *mut c_void,
}

#[repr(C)]
struct Stream {
    get_schema: Option<unsafe extern "C" fn(*mut Stream, *mut Schema) -> c_int>,
    get_next: Option<unsafe extern "C" fn(*mut Stream, *mut Array) -> c_int>,
    get_last_error: Option<unsafe extern "C" fn(*mut Stream) -> *const c_char>,
    release: Option<unsafe extern "C" fn(*mut Stream)>,
    private_data: *mut c_void,
}

/// What a schema owns.
struct OwnedSchema {
    name: CString,
    children: Vec<*mut Schema>,
}

/// What an array owns.
struct OwnedArray {
    #[allow(dead_code)] // `pointers` point into them
    buffers: Vec<Buffer>,
    pointers: Vec<*const c_void>,
    children: Vec<*mut Array>,
}

/// Memory of an array.
enum Buffer {
    None,
    Bytes(Vec<u8>),
    Numbers(Vec<f64>),
    Offsets(Vec<i64>),
}

impl Buffer {
    fn pointer(&self) -> *const c_void {
        match self {
            Buffer::None => null(),
            Buffer::Bytes(bytes) => bytes.as_ptr().cast(),
            Buffer::Numbers(numbers) => numbers.as_ptr().cast(),
            Buffer::Offsets(offsets) => offsets.as_ptr().cast(),
        }
    }
}

/// The name that the interface gives to a stream's capsule.
const STREAM: &CStr = c"arrow_array_stream";

/// A capsule that hands the table on, once.
///
/// # Errors
/// None in practice.
pub fn stream<'py>(py: Python<'py>, table: Table) -> PyResult<Bound<'py, PyCapsule>> {
    /// A stream that nobody took is released with its capsule.
    struct Held(Stream);
    // SAFETY: the memory behind it belongs to it alone.
    unsafe impl Send for Held {}
    impl Drop for Held {
        fn drop(&mut self) {
            if let Some(release) = self.0.release {
                // SAFETY: not released yet.
                unsafe { release(&raw mut self.0) };
            }
        }
    }
    let source = Source { schema: fields(&table), table: Some(table) };
    let stream = Stream {
        get_schema: Some(get_schema),
        get_next: Some(get_next),
        get_last_error: Some(get_last_error),
        release: Some(release_stream),
        private_data: Box::into_raw(Box::new(source)).cast(),
    };
    PyCapsule::new_with_value(py, Held(stream), STREAM)
}

/// Behind a stream: the names and formats of the columns, and the table until it is taken.
struct Source {
    schema: Vec<(&'static str, &'static CStr)>,
    table: Option<Table>,
}

/// Names and formats of the columns.
fn fields(table: &Table) -> Vec<(&'static str, &'static CStr)> {
    let format = |values: &Values| match values {
        Values::Numbers(_) => c"g",
        Values::Texts(_) => c"U",
        Values::Flags(_) => c"b",
    };
    table.0.iter().map(|(name, values)| (*name, format(values))).collect()
}

unsafe extern "C" fn get_schema(stream: *mut Stream, out: *mut Schema) -> c_int {
    // SAFETY: the consumer passes a stream of this module that it has not released, and room for a schema.
    unsafe {
        let source = &*(*stream).private_data.cast::<Source>();
        let children =
            source.schema.iter().map(|(name, format)| Box::into_raw(Box::new(schema(name, format, Vec::new()))));
        out.write(schema("", c"+s", children.collect()));
    }
    0
}

fn schema(name: &str, format: &'static CStr, children: Vec<*mut Schema>) -> Schema {
    let name = CString::new(name).unwrap_or_default();
    let mut owned = Box::new(OwnedSchema { name, children });
    Schema {
        format: format.as_ptr(),
        name: owned.name.as_ptr(),
        metadata: null(),
        flags: NULLABLE,
        n_children: owned.children.len() as i64,
        children: owned.children.as_mut_ptr(),
        dictionary: null_mut(),
        release: Some(release_schema),
        private_data: Box::into_raw(owned).cast(),
    }
}

unsafe extern "C" fn release_schema(schema: *mut Schema) {
    // SAFETY: a consumer releases what it got once; children that it moved elsewhere have no `release` any more.
    unsafe {
        let owned = Box::from_raw((*schema).private_data.cast::<OwnedSchema>());
        for &child in &owned.children {
            if let Some(release) = (*child).release {
                release(child);
            }
            drop(Box::from_raw(child));
        }
        (*schema).release = None;
    }
}

unsafe extern "C" fn get_next(stream: *mut Stream, out: *mut Array) -> c_int {
    // SAFETY: as in `get_schema`.
    unsafe {
        let source = &mut *(*stream).private_data.cast::<Source>();
        let Some(table) = source.table.take() else {
            // the end of the stream is an array that is released
            out.write(array(0, 0, Vec::new(), Vec::new()));
            if let Some(release) = (*out).release {
                release(out);
            }
            return 0;
        };
        let rows = table.rows();
        let columns = table.0.into_iter().map(|(_, values)| Box::into_raw(Box::new(column(values))));
        out.write(array(rows, 0, vec![Buffer::None], columns.collect()));
    }
    0
}

fn column(values: Values) -> Array {
    match values {
        Values::Numbers(numbers) => {
            let (known, unknown) = known(numbers.iter().map(|number| !number.is_nan()));
            array(numbers.len(), unknown, vec![known, Buffer::Numbers(numbers)], Vec::new())
        }
        Values::Texts(texts) => {
            let mut offsets = vec![0];
            let mut bytes = Vec::new();
            for text in &texts {
                bytes.extend_from_slice(text.as_deref().unwrap_or_default().as_bytes());
                offsets.push(bytes.len() as i64);
            }
            let (known, unknown) = known(texts.iter().map(Option::is_some));
            array(texts.len(), unknown, vec![known, Buffer::Offsets(offsets), Buffer::Bytes(bytes)], Vec::new())
        }
        Values::Flags(flags) => {
            let set = Buffer::Bytes(bits(flags.iter().copied()));
            array(flags.len(), 0, vec![Buffer::None, set], Vec::new())
        }
    }
}

/// Which values are known, where not all are, and how many are not.
fn known(known: impl ExactSizeIterator<Item = bool> + Clone) -> (Buffer, usize) {
    let unknown = known.clone().filter(|known| !known).count();
    (if unknown > 0 { Buffer::Bytes(bits(known)) } else { Buffer::None }, unknown)
}

/// A bit for each, the lowest first.
fn bits(flags: impl ExactSizeIterator<Item = bool>) -> Vec<u8> {
    let mut bytes = vec![0; flags.len().div_ceil(8)];
    flags.enumerate().filter(|(_, set)| *set).for_each(|(i, _)| bytes[i / 8] |= 1 << (i % 8));
    bytes
}

fn array(rows: usize, unknown: usize, buffers: Vec<Buffer>, children: Vec<*mut Array>) -> Array {
    let pointers = buffers.iter().map(Buffer::pointer).collect();
    let mut owned = Box::new(OwnedArray { buffers, pointers, children });
    Array {
        length: rows as i64,
        null_count: unknown as i64,
        offset: 0,
        n_buffers: owned.pointers.len() as i64,
        n_children: owned.children.len() as i64,
        buffers: owned.pointers.as_mut_ptr(),
        children: owned.children.as_mut_ptr(),
        dictionary: null_mut(),
        release: Some(release_array),
        private_data: Box::into_raw(owned).cast(),
    }
}

unsafe extern "C" fn release_array(array: *mut Array) {
    // SAFETY: as in `release_schema`.
    unsafe {
        let owned = Box::from_raw((*array).private_data.cast::<OwnedArray>());
        for &child in &owned.children {
            if let Some(release) = (*child).release {
                release(child);
            }
            drop(Box::from_raw(child));
        }
        (*array).release = None;
    }
}

/// Nothing goes wrong in here.
unsafe extern "C" fn get_last_error(_: *mut Stream) -> *const c_char {
    null()
}

unsafe extern "C" fn release_stream(stream: *mut Stream) {
    // SAFETY: a consumer, or the capsule, releases it once.
    unsafe {
        drop(Box::from_raw((*stream).private_data.cast::<Source>()));
        (*stream).release = None;
    }
}
