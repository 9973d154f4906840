//! Segments: a lead-in, metadata that tells what changed, raw data in chunks.

use std::collections::{BTreeMap, HashMap};

use crate::storage::import::tdms::bytes::Bytes;
use crate::storage::import::tdms::channel;
use crate::storage::import::tdms::channel::{Channel, Index, Timing};
use crate::storage::import::tdms::property::{Properties, Property};

const LEAD_IN: usize = 28;
const METADATA: u32 = 1 << 1;
const NEW_OBJECTS: u32 = 1 << 2;
const RAW_DATA: u32 = 1 << 3;
const INTERLEAVED: u32 = 1 << 5;
const BIG_ENDIAN: u32 = 1 << 6;
const DAQMX: u32 = 1 << 7;

/// An object in the order of its raw data, and what it has there.
type Listed = (String, Option<Index>);

/// What was read so far.
#[derive(Default)]
pub(crate) struct Reader {
    pub properties: BTreeMap<String, Properties>,
    pub channels: Vec<Channel>,
    places: HashMap<String, usize>,
    /// The last raw data index of each object: a segment may say "as before".
    indices: HashMap<String, Index>,
    list: Vec<Listed>,
    listed: HashMap<String, usize>,
}

impl Reader {
    /// Reads all segments; true where the last one is cut off.
    pub(crate) fn read(&mut self, bytes: &[u8]) -> Result<bool, String> {
        let mut at = 0;
        while at < bytes.len() {
            let lead_in = &bytes[at..(at + LEAD_IN).min(bytes.len())];
            if lead_in.len() < LEAD_IN {
                return Ok(true);
            }
            if !lead_in.starts_with(b"TDSm") {
                return Err(format!("no segment begins at byte {at}, where one should: the file is damaged"));
            }
            let flags = Bytes::new(&lead_in[4..], false).u32()?;
            let mut rest = Bytes::new(&lead_in[8..], flags & BIG_ENDIAN != 0);
            let (_version, next, raw) = (rest.u32()?, rest.u64()?, rest.u64()?);
            let body = &bytes[at + LEAD_IN..];
            // a segment that was not finished has no length
            let length = if next == u64::MAX { usize::MAX } else { usize::try_from(next).unwrap_or(usize::MAX) };
            let cut = length > body.len();
            let body = &body[..length.min(body.len())];
            let raw = usize::try_from(raw).unwrap_or(usize::MAX);
            if raw > body.len() {
                if cut {
                    return Ok(true);
                }
                return Err(format!(
                    "the raw data of the segment at byte {at} begin after its end: the file is damaged"
                ));
            }
            let (metadata, data) = body.split_at(raw);
            if flags & METADATA != 0 {
                self.metadata(Bytes::new(metadata, flags & BIG_ENDIAN != 0), flags & NEW_OBJECTS != 0)?;
            }
            if flags & RAW_DATA != 0 {
                if flags & DAQMX != 0 {
                    return Err(daqmx());
                }
                self.raw_data(Bytes::new(data, flags & BIG_ENDIAN != 0), flags & INTERLEAVED != 0)?;
            }
            if cut {
                return Ok(true);
            }
            at += LEAD_IN + length;
        }
        Ok(false)
    }

    fn metadata(&mut self, mut bytes: Bytes<'_>, new_list: bool) -> Result<(), String> {
        if new_list {
            self.list.clear();
            self.listed.clear();
        }
        for _ in 0..bytes.u32()? {
            let path = bytes.text()?;
            let index = match bytes.u32()? {
                u32::MAX => None,
                0 => {
                    let before = self.indices.get(&path).copied();
                    Some(before.ok_or_else(|| format!("{path} refers to an earlier index, but there is none"))?)
                }
                0x69120000 | 0x69130000 | 0x6912 | 0x6913 | 0x1269 | 0x1369 => return Err(daqmx()),
                _ => Some(Index::read(&mut bytes)?),
            };
            if let Some(index) = index {
                self.indices.insert(path.clone(), index);
            }
            match self.listed.get(&path) {
                Some(&place) => self.list[place].1 = index,
                None => {
                    self.listed.insert(path.clone(), self.list.len());
                    self.list.push((path.clone(), index));
                }
            }
            let properties = self.properties.entry(path.clone()).or_default();
            let before = Timing::of(properties);
            for _ in 0..bytes.u32()? {
                let key = bytes.text()?;
                properties.insert(key, read_property(&mut bytes)?);
            }
            let channel = self.places.get(&path).map(|place| &mut self.channels[*place]);
            if let Some(channel) =
                channel.filter(|channel| channel.values.len() > 0 && before.ends_with(Timing::of(properties)))
            {
                channel.earlier.push((channel.values.len(), before));
            }
        }
        Ok(())
    }

    fn raw_data(&mut self, data: Bytes<'_>, interleaved: bool) -> Result<(), String> {
        let present: Vec<(String, Index)> =
            self.list.iter().filter_map(|(path, index)| Some((path.clone(), index.filter(|i| i.bytes > 0)?))).collect();
        let chunk = present.iter().try_fold(0u64, |sum, (_, index)| sum.checked_add(index.bytes));
        let chunk = chunk
            .and_then(|c| usize::try_from(c).ok())
            .ok_or("a segment is longer than any file: the file is damaged")?;
        if chunk == 0 {
            return Ok(());
        }
        if interleaved {
            let sizes: Option<Vec<usize>> =
                present.iter().map(|(_, i)| channel::size(i.code).map(|s| s as usize)).collect();
            let sizes = sizes.ok_or("text cannot be interleaved: the file is damaged")?;
            let stride: usize = sizes.iter().sum();
            let mut offset = 0;
            for ((path, index), size) in present.iter().zip(sizes) {
                // every channel has a value in each row: the rows go on to the end of the segment
                let rows = data.len() / stride;
                self.channel(path, index.code).extend(data, index.code, offset, stride, rows as u64)?;
                offset += size;
            }
            return Ok(());
        }
        let mut at = 0;
        while at < data.len() {
            for (path, index) in &present {
                let size = channel::size(index.code).unwrap_or(1) as usize;
                let bytes = usize::try_from(index.bytes).unwrap_or(usize::MAX);
                let end = at.saturating_add(bytes).min(data.len());
                let mut window = data;
                window.take(at)?;
                let count = if end - at < bytes { ((end - at) / size) as u64 } else { index.count };
                self.channel(path, index.code).extend(window, index.code, 0, size, count)?;
                at = end;
            }
        }
        Ok(())
    }

    fn channel(&mut self, path: &str, code: u32) -> &mut Channel {
        let place = *self.places.entry(path.to_string()).or_insert_with(|| {
            self.channels.push(Channel::new(path, code));
            self.channels.len() - 1
        });
        &mut self.channels[place]
    }
}

fn read_property(bytes: &mut Bytes<'_>) -> Result<Property, String> {
    let code = bytes.u32()?;
    Ok(match code {
        0x20 => Property::Text(bytes.text()?),
        0x44 => Property::Time(bytes.time()?),
        code if channel::is_number(code) => Property::Number(bytes.number(code)?),
        code => {
            let size = channel::size(code).ok_or_else(|| format!("a property has the unknown type 0x{code:x}"))?;
            bytes.take(size as usize)?;
            Property::Text(String::new())
        }
    })
}

fn daqmx() -> String {
    "it holds raw DAQmx data, which only NI's driver can turn into numbers: in LabVIEW or DIAdem save it as a TDMS file of scaled \
     values, or export it as CSV"
        .into()
}

/// The names in an object's path: `/'Group'/'Channel'`, with quotes inside doubled.
pub(crate) fn names(path: &str) -> Vec<String> {
    let mut names = Vec::new();
    let mut name: Option<String> = None;
    let mut chars = path.chars().peekable();
    while let Some(c) = chars.next() {
        match (&mut name, c) {
            (None, '\'') => name = Some(String::new()),
            (Some(text), '\'') if chars.peek() == Some(&'\'') => {
                text.push('\'');
                chars.next();
            }
            (Some(_), '\'') => names.extend(name.take()),
            (Some(text), c) => text.push(c),
            (None, _) => {}
        }
    }
    names
}
