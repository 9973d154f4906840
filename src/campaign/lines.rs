//! Lines that a reader can trust: each begins with the checksum of its rest, so that one cut off by a crash or a full
//! disk is none.
//!
//! A line is a JSON object, `{"check":"1f3a…","task":…}`; `check` is the CRC-32 (as in zip files) of what follows it,
//! in hexadecimal.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

const CRC: crc::Crc<u32, crc::Table<16>> = crc::Crc::<u32, crc::Table<16>>::new(&crc::CRC_32_ISO_HDLC);
const HEAD: &str = "{\"check\":\"";
/// Digits of the checksum, the quotation mark and the comma.
const CHECK: usize = 10;

/// The line of an object that is written already, `{…}` with at least one entry and no line break; ends with a line
/// break.
pub fn sealed(object: &str) -> String {
    let rest = &object[1..];
    format!("{HEAD}{:08x}\",{rest}\n", CRC.checksum(rest.as_bytes()))
}

/// Whether a line, without its line break, is as it was written.
pub(crate) fn is_whole(line: &str) -> bool {
    let Some((check, rest)) = line.strip_prefix(HEAD).and_then(|rest| rest.split_at_checked(CHECK)) else {
        return false;
    };
    let stated = check.strip_suffix("\",").and_then(|digits| u32::from_str_radix(digits, 16).ok());
    stated == Some(CRC.checksum(rest.as_bytes()))
}

/// Gives each whole line of a file to `take`; returns how many others there are.
///
/// # Errors
/// A file that cannot be read.
pub(crate) fn read(path: &Path, mut take: impl FnMut(&str)) -> io::Result<usize> {
    let mut reader = BufReader::with_capacity(1 << 18, File::open(path)?);
    let (mut line, mut damaged) = (Vec::new(), 0);
    loop {
        line.clear();
        if reader.read_until(b'\n', &mut line)? == 0 {
            return Ok(damaged);
        }
        match std::str::from_utf8(line.strip_suffix(b"\n").unwrap_or(&line)) {
            Ok(text) if is_whole(text) => take(text),
            _ => damaged += 1,
        }
    }
}

/// The first whole line of a file.
///
/// # Errors
/// A file that cannot be read.
pub(crate) fn first(path: &Path) -> io::Result<Option<String>> {
    for line in BufReader::new(File::open(path)?).split(b'\n') {
        if let Some(line) = String::from_utf8(line?).ok().filter(|line| is_whole(line)) {
            return Ok(Some(line));
        }
    }
    Ok(None)
}

/// The whole lines among the last bytes of a file.
///
/// # Errors
/// A file that cannot be read.
pub(crate) fn last(path: &Path, bytes: u64) -> io::Result<Vec<String>> {
    let mut file = File::open(path)?;
    let length = file.metadata()?.len();
    file.seek(SeekFrom::Start(length.saturating_sub(bytes)))?;
    let mut text = Vec::new();
    file.read_to_end(&mut text)?;
    let text = String::from_utf8_lossy(&text);
    Ok(text.lines().filter(|line| is_whole(line)).map(str::to_owned).collect())
}

/// The files of a folder that hold such lines, by name; none where there is no folder.
///
/// # Errors
/// A folder that cannot be listed.
pub(crate) fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries?,
    };
    let mut paths = entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
    paths.retain(|path| path.extension().is_some_and(|e| e == "jsonl"));
    paths.sort();
    Ok(paths)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_cut_or_flipped_anywhere_is_none() {
        let line = sealed("{\"task\":\"a\",\"answer\":{\"x\":1.5}}");
        let line = line.trim_end();
        assert!(is_whole(line));
        assert!(serde_json::from_str::<serde_json::Value>(line).unwrap()["answer"]["x"] == 1.5);
        for end in 0..line.len() {
            assert!(!is_whole(&line[..end]), "{}", &line[..end]);
        }
        for at in 0..line.len() {
            let mut bytes = line.as_bytes().to_vec();
            bytes[at] ^= 1;
            assert!(!is_whole(std::str::from_utf8(&bytes).unwrap()), "{at}");
        }
    }

    #[test]
    fn a_torn_end_is_counted_and_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.jsonl");
        let [one, two] = [1, 2].map(|n| sealed(&format!("{{\"task\":\"{n}\"}}")));
        std::fs::write(&path, format!("{one}{}", &two[..20])).unwrap();
        let mut seen = Vec::new();
        assert_eq!(read(&path, |line| seen.push(line.to_owned())).unwrap(), 1);
        assert_eq!((first(&path).unwrap(), last(&path, 1000).unwrap()), (seen.first().cloned(), seen));
        assert_eq!(files(folder.path()).unwrap(), [path]);
        assert!(files(&folder.path().join("none")).unwrap().is_empty());
    }
}
