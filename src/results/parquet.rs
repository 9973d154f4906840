//! Columns of numbers and texts as Parquet, the least of the format: one row group, one plain page a column, nothing
//! compressed.
//!
//! See `parquet.thrift` of apache/parquet-format; headers are in Thrift's compact protocol. What is no number is stored
//! as such.

const MAGIC: &[u8] = b"PAR1";

/// Enumerations of the format.
const DOUBLE: i64 = 5;
const BYTE_ARRAY: i64 = 6;
const UTF8: i64 = 0;
const REQUIRED: i64 = 0;
const PLAIN: i64 = 0;
const RLE: i64 = 3;
const UNCOMPRESSED: i64 = 0;
const DATA_PAGE: i64 = 0;

/// Types of Thrift's compact protocol.
const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// A structure as it is written: fields in ascending order, each with its distance from the last.
#[derive(Default)]
struct Thrift {
    bytes: Vec<u8>,
    last: u8,
}

fn varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// Small numbers of either sign become small numbers without one.
fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)) as u64
}

fn text(bytes: &mut Vec<u8>, text: &str) {
    varint(bytes, text.len() as u64);
    bytes.extend(text.as_bytes());
}

impl Thrift {
    fn field(mut self, id: u8, kind: u8, value: impl FnOnce(&mut Vec<u8>)) -> Self {
        self.bytes.push((id - self.last) << 4 | kind);
        self.last = id;
        value(&mut self.bytes);
        self
    }

    fn number(self, id: u8, kind: u8, value: i64) -> Self {
        self.field(id, kind, |bytes| varint(bytes, zigzag(value)))
    }

    fn name(self, id: u8, name: &str) -> Self {
        self.field(id, BINARY, |bytes| text(bytes, name))
    }

    fn structure(self, id: u8, of: Thrift) -> Self {
        self.field(id, STRUCT, |bytes| bytes.extend(of.end()))
    }

    /// A list of elements that are written already.
    fn list(self, id: u8, kind: u8, elements: &[Vec<u8>]) -> Self {
        self.field(id, LIST, |bytes| {
            match elements.len() {
                few @ 0..15 => bytes.push((few as u8) << 4 | kind),
                many => {
                    bytes.push(0xf0 | kind);
                    varint(bytes, many as u64);
                }
            }
            elements.iter().for_each(|element| bytes.extend(element));
        })
    }

    fn end(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}

/// A column's values.
#[derive(Debug, Clone, Copy)]
pub enum Column<'a> {
    /// Numbers, NaN where there is none.
    Numbers(&'a [f64]),
    /// Texts, empty where there is none.
    Texts(&'a [&'a str]),
}

impl Column<'_> {
    fn len(self) -> usize {
        match self {
            Column::Numbers(values) => values.len(),
            Column::Texts(values) => values.len(),
        }
    }

    /// The column's type, as its pages and its schema name it.
    fn kind(self) -> i64 {
        match self {
            Column::Numbers(_) => DOUBLE,
            Column::Texts(_) => BYTE_ARRAY,
        }
    }

    fn plain(self) -> Vec<u8> {
        match self {
            Column::Numbers(values) => values.iter().flat_map(|value| value.to_le_bytes()).collect(),
            Column::Texts(values) => {
                let text = |text: &&str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
                values.iter().flat_map(text).collect()
            }
        }
    }

    fn schema(self, name: &str) -> Vec<u8> {
        let element = Thrift::default().number(1, I32, self.kind()).number(3, I32, REQUIRED).name(4, name);
        match self {
            Column::Numbers(_) => element.end(),
            Column::Texts(_) => element.number(6, I32, UTF8).end(),
        }
    }
}

/// Columns of one length as a Parquet file.
pub fn parquet(columns: &[(String, Column)]) -> Vec<u8> {
    let rows = columns.first().map_or(0, |(_, values)| values.len()) as i64;
    let mut file = MAGIC.to_vec();
    let mut chunks = Vec::new();
    let root = Thrift::default().name(4, "schema").number(5, I32, columns.len() as i64);
    let mut schema = vec![root.end()];
    for (name, values) in columns {
        let place = file.len() as i64;
        let bytes = values.plain();
        let size = bytes.len() as i64;
        let page = Thrift::default().number(1, I32, rows).number(2, I32, PLAIN).number(3, I32, RLE).number(4, I32, RLE);
        let header = Thrift::default().number(1, I32, DATA_PAGE).number(2, I32, size).number(3, I32, size);
        file.extend(header.structure(5, page).end());
        file.extend(bytes);
        let written = file.len() as i64 - place;
        let mut encoding = Vec::new();
        varint(&mut encoding, zigzag(PLAIN));
        let mut path = Vec::new();
        text(&mut path, name);
        let about = Thrift::default()
            .number(1, I32, values.kind())
            .list(2, I32, &[encoding])
            .list(3, BINARY, &[path])
            .number(4, I32, UNCOMPRESSED)
            .number(5, I64, rows)
            .number(6, I64, written)
            .number(7, I64, written)
            .number(9, I64, place);
        chunks.push(Thrift::default().number(2, I64, place).structure(3, about).end());
        schema.push(values.schema(name));
    }
    let bytes = file.len() as i64 - MAGIC.len() as i64;
    let group = Thrift::default().list(1, STRUCT, &chunks).number(2, I64, bytes).number(3, I64, rows).end();
    let footer = Thrift::default()
        .number(1, I32, 1)
        .list(2, STRUCT, &schema)
        .number(3, I64, rows)
        .list(4, STRUCT, &[group])
        .name(6, concat!("surgescope ", env!("CARGO_PKG_VERSION")))
        .end();
    file.extend(&footer);
    file.extend((footer.len() as u32).to_le_bytes());
    file.extend(MAGIC);
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_stand_plain_between_their_headers() {
        let columns = [
            ("time_s".into(), Column::Numbers(&[0.5, 1.5])),
            ("model_m".into(), Column::Numbers(&[-2.0, f64::NAN])),
            ("run".into(), Column::Texts(&["", "Größe"])),
        ];
        let file = parquet(&columns);
        assert!(file.starts_with(MAGIC) && file.ends_with(MAGIC));
        let footer = u32::from_le_bytes(file[file.len() - 8..][..4].try_into().unwrap()) as usize;
        let text = String::from_utf8_lossy(&file[file.len() - 8 - footer..]).into_owned();
        assert!(["time_s", "model_m", "run"].iter().all(|name| text.contains(name)), "{text}");
        let holds = |bytes: &[u8]| file.windows(bytes.len()).any(|b| b == bytes);
        let has = |value: f64| holds(&value.to_le_bytes());
        assert!(has(0.5) && has(1.5) && has(-2.0) && !has(3.0));
        assert!(holds("\0\0\0\0\u{7}\0\0\0Größe".as_bytes()));
    }

    #[test]
    fn numbers_are_written_as_thrift_writes_them() {
        let mut bytes = Vec::new();
        [0, -1, 1, 300].into_iter().for_each(|value| varint(&mut bytes, zigzag(value)));
        assert_eq!(bytes, [0, 1, 2, 0xd8, 0x04]);
    }
}
