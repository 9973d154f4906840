//! Lengths inside MCAP records, checked before the MCAP library takes them on trust: it sets aside what they ask for,
//! up to 4 GiB.

use mcap::records::op;

/// A part of a record's body.
enum Part {
    /// Bytes of no length of their own.
    Skip(usize),
    /// A length of four bytes and as many bytes.
    Text,
    /// A length in bytes, and pairs of texts.
    Map,
    /// A length in bytes, and entries of so many each: the library reads the last to its end, wherever the length says
    /// that they end.
    Entries(usize),
}

/// Does every text of a record lie in its body?
pub fn texts_fit(opcode: u8, body: &[u8]) -> bool {
    use Part::{Entries, Map, Skip, Text};
    let parts: &[Part] = match opcode {
        op::HEADER => &[Text, Text],
        op::SCHEMA => &[Skip(2), Text, Text, Text],
        op::CHANNEL => &[Skip(4), Text, Text, Map],
        op::ATTACHMENT => &[Skip(16), Text, Text],
        op::METADATA => &[Text, Map],
        op::CHUNK_INDEX => &[Skip(32), Entries(10), Skip(8), Text],
        op::ATTACHMENT_INDEX => &[Skip(40), Text, Text],
        op::METADATA_INDEX => &[Skip(16), Text],
        _ => &[],
    };
    fit(parts, body).is_some()
}

fn fit(parts: &[Part], mut body: &[u8]) -> Option<()> {
    for part in parts {
        match part {
            Part::Skip(count) => body = body.get(*count..)?,
            Part::Text => body = text(body)?.1,
            Part::Entries(size) => {
                let (entries, rest) = text(body)?;
                body = entries.len().is_multiple_of(*size).then_some(rest)?;
            }
            Part::Map => {
                let (mut entries, rest) = text(body)?;
                while !entries.is_empty() {
                    entries = text(text(entries)?.1)?.1;
                }
                body = rest;
            }
        }
    }
    Some(())
}

/// The bytes that a length stands before, and those after them.
fn text(body: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = body.split_first_chunk::<4>()?;
    rest.split_at_checked(u32::from_le_bytes(*length) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_length_beyond_the_record_is_found_in_every_part() {
        let channel = b"\x01\0\x02\0\x02\0\0\0/P\x04\0\0\0json\x0b\0\0\0\x01\0\0\0a\x02\0\0\0bc";
        assert!(texts_fit(op::CHANNEL, channel));
        for place in [4, 10, 18, 22, 27] {
            let mut damaged = channel.to_vec();
            damaged[place + 3] = 0x75;
            assert!(!texts_fit(op::CHANNEL, &damaged), "{place}");
        }
        let mut index = vec![0; 32];
        index.extend(b"\x14\0\0\0\x01\0offset:1\x02\0offset:2length:8\x04\0\0\0zstdcompressplain...");
        assert!(texts_fit(op::CHUNK_INDEX, &index));
        index[32] = 0x13;
        index.remove(36);
        assert!(!texts_fit(op::CHUNK_INDEX, &index), "half an entry shifts what comes behind");
        assert!(texts_fit(op::HEADER, b"\0\0\0\0\0\0\0\0") && !texts_fit(op::HEADER, b"\0\0suan bytes"));
        assert!(texts_fit(op::MESSAGE, b"") && !texts_fit(op::METADATA, b""));
    }
}
