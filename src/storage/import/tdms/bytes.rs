//! Numbers and strings out of bytes that may end anywhere.

/// A place in a file, its byte order and how far it may read.
#[derive(Clone, Copy)]
pub(crate) struct Bytes<'b> {
    rest: &'b [u8],
    big_endian: bool,
}

impl<'b> Bytes<'b> {
    pub(crate) fn new(bytes: &'b [u8], big_endian: bool) -> Bytes<'b> {
        Bytes { rest: bytes, big_endian }
    }

    pub(crate) fn is_big_endian(&self) -> bool {
        self.big_endian
    }

    pub(crate) fn len(&self) -> usize {
        self.rest.len()
    }

    pub(crate) fn take(&mut self, count: usize) -> Result<&'b [u8], String> {
        let (taken, rest) =
            self.rest.split_at_checked(count).ok_or("its metadata ends early: the file is damaged or cut off")?;
        self.rest = rest;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let mut bytes = [0; N];
        bytes.copy_from_slice(self.take(N)?);
        if self.big_endian {
            bytes.reverse();
        }
        Ok(bytes)
    }

    pub(crate) fn u32(&mut self) -> Result<u32, String> {
        self.array().map(u32::from_le_bytes)
    }

    pub(crate) fn u64(&mut self) -> Result<u64, String> {
        self.array().map(u64::from_le_bytes)
    }

    pub(crate) fn text(&mut self) -> Result<String, String> {
        let length = self.u32()? as usize;
        Ok(String::from_utf8_lossy(self.take(length)?).into_owned())
    }

    /// A number of a type that [`crate::storage::import::tdms::channel::Type::size`] gives a size for.
    pub(crate) fn number(&mut self, code: u32) -> Result<f64, String> {
        Ok(match code {
            1 => f64::from(i8::from_le_bytes(self.array()?)),
            2 => f64::from(i16::from_le_bytes(self.array()?)),
            3 => f64::from(i32::from_le_bytes(self.array()?)),
            4 => i64::from_le_bytes(self.array()?) as f64,
            5 | 0x21 => f64::from(u8::from_le_bytes(self.array()?)),
            6 => f64::from(u16::from_le_bytes(self.array()?)),
            7 => f64::from(u32::from_le_bytes(self.array()?)),
            8 => u64::from_le_bytes(self.array()?) as f64,
            9 | 0x19 => f64::from(f32::from_le_bytes(self.array()?)),
            _ => f64::from_le_bytes(self.array()?),
        })
    }

    /// A timestamp: 2⁻⁶⁴ s and seconds since 1904, as nanoseconds since 1970 UTC.
    pub(crate) fn time(&mut self) -> Result<i64, String> {
        const SINCE_1904_S: i64 = 2_082_844_800;
        // in big endian the whole of sixteen bytes is turned round
        let bytes: [u8; 16] = self.array()?;
        let (fraction, seconds) = bytes.split_at(8);
        let fraction = u64::from_le_bytes(fraction.try_into().unwrap_or_default());
        let seconds = i64::from_le_bytes(seconds.try_into().unwrap_or_default());
        let ns = ((u128::from(fraction) * 1_000_000_000 + (1 << 63)) >> 64) as i64;
        Ok(seconds.saturating_sub(SINCE_1904_S).saturating_mul(1_000_000_000).saturating_add(ns))
    }
}
