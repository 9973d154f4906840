//! An end for a live file that cannot be finished, as on a full disk: cut to its last whole record and closed where it
//! stands.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};

use mcap::MAGIC;
use mcap::records::op;

/// Bytes of a record before its body: opcode and length.
const HEAD: u64 = 9;
/// How many records are given up, one by one, for the few bytes of an end.
const MOST_GIVEN_UP: usize = 64;

/// Closes a live file in place; returns how many bytes of it were cut away. It is then read as any other, though it is
/// neither compressed nor indexed.
pub fn end_in_place(file: &mut File) -> io::Result<u64> {
    let length = file.seek(SeekFrom::End(0))?;
    let mut boundaries = boundaries(file, length)?;
    loop {
        let Some(boundary) = boundaries.pop() else { return Err(io::Error::other("no record of it is whole")) };
        file.set_len(boundary)?;
        file.seek(SeekFrom::Start(boundary))?;
        match file.write_all(&end()).and_then(|()| file.sync_all()) {
            Ok(()) => return Ok(length - boundary),
            Err(error) if boundaries.is_empty() => return Err(error),
            Err(_) => {}
        }
    }
}

/// The ends of the last whole records.
fn boundaries(file: &mut File, length: u64) -> io::Result<Vec<u64>> {
    let mut ends = Vec::new();
    let mut at = MAGIC.len() as u64;
    file.seek(SeekFrom::Start(at))?;
    let mut reader = BufReader::new(file);
    while at + HEAD <= length {
        let mut head = [0; HEAD as usize];
        reader.read_exact(&mut head)?;
        let [opcode, body @ ..] = head;
        let body = u64::from_le_bytes(body);
        let Some(end) = (at + HEAD).checked_add(body).filter(|end| *end <= length && opcode != 0) else { break };
        reader.seek_relative(i64::try_from(body).map_err(io::Error::other)?)?;
        at = end;
        if ends.len() > MOST_GIVEN_UP {
            ends.remove(0);
        }
        ends.push(at);
    }
    Ok(ends)
}

/// End of data, footer and magic bytes of a file without a summary; sums of 0 say that there are none.
fn end() -> Vec<u8> {
    let mut bytes = Vec::new();
    for (opcode, body) in [(op::DATA_END, 4), (op::FOOTER, 20)] {
        bytes.push(opcode);
        bytes.extend(u64::to_le_bytes(body));
        bytes.resize(bytes.len() + body as usize, 0);
    }
    bytes.extend(MAGIC);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::RunInfo;
    use crate::storage::fixtures::{place, rig};
    use crate::storage::{Writer, read};

    #[test]
    fn a_file_cut_anywhere_is_closed_behind_its_last_whole_record() {
        let (_folder, path) = place("run.mcap");
        let mut writer = Writer::create(&path, &rig(), &RunInfo::default()).unwrap();
        let head = std::fs::metadata(&path).unwrap().len() as usize;
        for index in 0..20 {
            writer.sample(0, index * 1_000_000, index as f64).unwrap();
            writer.flush().unwrap();
        }
        drop(writer);
        let bytes = std::fs::read(&path).unwrap();
        let mut most = 0;
        for length in (head..bytes.len()).step_by(7) {
            let mut file = File::options().read(true).write(true).truncate(true).open(&path).unwrap();
            file.write_all(&bytes[..length]).unwrap();
            let cut = end_in_place(&mut file).unwrap();
            let values = &read(&path).unwrap().series[0].value;
            assert!(values.iter().enumerate().all(|(i, v)| *v == i as f64), "{values:?}");
            // The first chunk holds what the others only name.
            assert!(values.len() >= most && cut < 4000, "{} values, {cut} bytes cut of {length}", values.len());
            most = values.len();
        }
        assert!(most >= 19, "{most}");
    }
}
