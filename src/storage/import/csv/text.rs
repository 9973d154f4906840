//! Bytes become text: UTF-8, UTF-16, and older code pages, which the bytes only suggest: letters decide among them, and
//! numbers are the same in all.

use std::borrow::Cow;
use std::collections::BTreeSet;

use chardetng::{EncodingDetector, Iso2022JpDetection, Utf8Detection};
use encoding_rs::{Encoding, UTF_8, UTF_16BE, UTF_16LE, WINDOWS_1252};

use crate::storage::error::{CsvFault, CsvProblem};
use crate::storage::import::source::{Repair, SourceOptions};

/// Bytes, or lines with other letters than ASCII, by which an encoding is judged.
const JUDGED: usize = 4096;

/// The signs of units in the pages of western Europe: `°`, `µ`, `²`, `³`, `±`.
const UNIT_SIGNS: [u8; 5] = [0xb0, 0xb5, 0xb2, 0xb3, 0xb1];

/// A longer line is none of a table, bytes.
const LONGEST_LINE: usize = 16 << 20;

/// Refuses a line so long that reading it as a row would take all memory.
pub(crate) fn check_lines(bytes: &[u8]) -> Result<(), CsvFault> {
    let mut at = 0;
    while bytes.len() - at > LONGEST_LINE {
        let end = bytes[at..at + LONGEST_LINE].iter().rposition(|b| matches!(b, b'\n' | b'\r'));
        let Some(end) = end else {
            return Err((None, Box::new(CsvProblem::LongLine { mebibytes: LONGEST_LINE >> 20 })));
        };
        at += end + 1;
    }
    Ok(())
}

/// The text of a file, its lines ended by line feeds.
pub(crate) fn decode<'b>(
    bytes: &'b [u8],
    options: &SourceOptions,
    repairs: &mut Vec<Repair>,
) -> Result<Cow<'b, str>, CsvFault> {
    let text = match options.encoding {
        Some(encoding) => stated(bytes, encoding)?,
        None => characters(bytes, repairs)?,
    };
    if text.contains('\n') || !text.contains('\r') {
        return Ok(text);
    }
    repairs.push(Repair::new("line-ends", 1, None, "lines end in carriage returns alone, as on old Macintoshes"));
    Ok(Cow::Owned(text.replace('\r', "\n")))
}

/// Read as the user says.
fn stated<'b>(bytes: &'b [u8], encoding: &'static Encoding) -> Result<Cow<'b, str>, CsvFault> {
    let bytes = Encoding::for_bom(bytes).map_or(bytes, |(_, length)| &bytes[length..]);
    let text = encoding.decode_without_bom_handling_and_without_replacement(bytes);
    text.ok_or_else(|| {
        let at = first_fault(bytes, encoding);
        (Some(line_of(bytes, at)), Box::new(CsvProblem::NotInEncoding { encoding: encoding.name() }))
    })
}

/// Where the first bytes stand that an encoding does not have.
fn first_fault(bytes: &[u8], encoding: &'static Encoding) -> usize {
    let mut decoder = encoding.new_decoder_without_bom_handling();
    let room = decoder.max_utf8_buffer_length_without_replacement(bytes.len()).unwrap_or_default();
    decoder.decode_to_string_without_replacement(bytes, &mut String::with_capacity(room), true).1
}

fn line_of(bytes: &[u8], at: usize) -> usize {
    1 + bytes[..at.min(bytes.len())].iter().filter(|b| **b == b'\n').count()
}

fn characters<'b>(bytes: &'b [u8], repairs: &mut Vec<Repair>) -> Result<Cow<'b, str>, CsvFault> {
    let marked = Encoding::for_bom(bytes);
    if let Some((encoding, length)) =
        marked.filter(|(encoding, _)| *encoding != UTF_8).or_else(|| Some((utf16(bytes)?, 0)))
    {
        let text = encoding.decode_without_bom_handling_and_without_replacement(&bytes[length..]);
        let hint = " (nor UTF-16, which its first bytes promise)";
        let text = text.ok_or((None, Box::new(CsvProblem::NotUtf8 { hint })))?;
        repairs.push(Repair::new("encoding", 1, None, "the text is UTF-16"));
        return Ok(text);
    }
    match text_of(bytes) {
        Ok(text) => {
            if marked.is_some() {
                repairs.push(Repair::new("byte-order-mark", 1, Some(1), "the file begins with a byte-order mark"));
            }
            Ok(Cow::Borrowed(text))
        }
        // no text has such bytes
        Err(fault) if bytes.contains(&0) => Err(fault),
        Err((line, _)) => {
            let (encoding, text) = guessed(bytes);
            let text_said = format!(
                "the text is not UTF-8 and was read as {}: if a name looks wrong, give its code page with option `encoding`",
                encoding.name()
            );
            repairs.push(Repair::new("encoding", 1, line, text_said));
            Ok(Cow::Owned(text))
        }
    }
}

/// UTF-16 without a mark: of what Latin letters and digits take, every other byte is zero.
fn utf16(bytes: &[u8]) -> Option<&'static Encoding> {
    let head = &bytes[..bytes.len().min(JUDGED)];
    let zeros = |odd: usize| head.iter().skip(odd).step_by(2).filter(|b| **b == 0).count();
    let mostly = |zeros: usize| 3 * zeros > 2 * (head.len() / 2) && zeros > 1;
    match (zeros(0), zeros(1)) {
        (0, high) if mostly(high) => Some(UTF_16LE),
        (high, 0) if mostly(high) => Some(UTF_16BE),
        _ => None,
    }
}

/// The likeliest code page and the text in it.
fn guessed(bytes: &[u8]) -> (&'static Encoding, String) {
    // Each line with letters beyond ASCII counts once, or a column of one sign would outvote the words.
    let lines: BTreeSet<&[u8]> = bytes.split(|b| *b == b'\n').filter(|line| !line.is_ascii()).collect();
    // signs of units alone are no words by which a page can be told
    let is_sign = |b: &u8| b.is_ascii() || UNIT_SIGNS.contains(b);
    if lines.iter().all(|line| line.iter().all(is_sign)) {
        return (WINDOWS_1252, WINDOWS_1252.decode_without_bom_handling(bytes).0.into_owned());
    }
    let mut detector = EncodingDetector::new(Iso2022JpDetection::Deny);
    for line in lines.into_iter().take(JUDGED) {
        detector.feed(line, false);
        detector.feed(b"\n", false);
    }
    detector.feed(b"", true);
    let likeliest = detector.guess(None, Utf8Detection::Deny);
    match likeliest.decode_without_bom_handling_and_without_replacement(bytes) {
        Some(text) => (likeliest, text.into_owned()),
        // which every byte fits
        None => (WINDOWS_1252, WINDOWS_1252.decode_without_bom_handling(bytes).0.into_owned()),
    }
}

/// The encoding that a user means: `cp932`, `shift-jis`, `cp1250`, `latin1`, `gbk`, `utf-16`, ….
///
/// # Errors
/// One that is not known.
pub fn encoding_named(name: &str) -> Result<&'static Encoding, String> {
    let plain = name.trim().to_lowercase();
    let label = match plain.strip_prefix("cp").or(plain.strip_prefix("windows-")) {
        Some("932") => "shift_jis".to_owned(),
        Some("936") => "gbk".to_owned(),
        Some("949") => "euc-kr".to_owned(),
        Some("950") => "big5".to_owned(),
        Some("65001") => "utf-8".to_owned(),
        Some(page) if page.starts_with("125") => format!("windows-{page}"),
        _ => plain,
    };
    Encoding::for_label(label.as_bytes())
        .ok_or_else(|| format!("'{name}' is not known: write it like cp932, cp1251, gbk, latin1 or utf-16"))
}

/// UTF-8 text without its byte-order mark.
pub(crate) fn text_of(bytes: &[u8]) -> Result<&str, CsvFault> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let utf16 = bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]);
        let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count();
        let hint = if utf16 { " (UTF-16, by its first bytes)" } else { "" };
        (Some(line), CsvProblem::NotUtf8 { hint }.into())
    })?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

/// How files of other kinds begin, in lower case, what they are, and what to do with them.
const OTHER_KINDS: [(&[u8], &str, &str); 11] = [
    (b"\x1f\x8b", "a file packed by gzip", UNPACK),
    (b"bzh", "a file packed by bzip2", UNPACK),
    (b"\x28\xb5\x2f\xfd", "a file packed by zstd", UNPACK),
    (b"\xfd7zxz", "a file packed by xz", UNPACK),
    (b"cdf\x01", "a netCDF file of version 3", SAVE),
    (b"cdf\x02", "a netCDF file of version 3", SAVE),
    (b"par1", "a Parquet file", SAVE),
    (b"<?xml", "XML", SAVE),
    (b"<html", "a page of HTML", SAVE),
    (b"<!doctype", "a page of HTML", SAVE),
    (b"<table", "a page of HTML", SAVE),
];
const UNPACK: &str = "unpack it first";
const SAVE: &str = "save it as CSV in the program that wrote it";

/// Refuses what is no table by its first bytes.
pub(crate) fn check_kind(bytes: &[u8]) -> Result<(), CsvFault> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let begins = |mark: &[u8]| text.get(..mark.len()).is_some_and(|start| start.eq_ignore_ascii_case(mark));
    match OTHER_KINDS.iter().find(|(mark, ..)| begins(mark)) {
        Some(&(_, what, doing)) => Err((None, Box::new(CsvProblem::OtherKind { what, doing }))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn files_of_other_kinds_are_called_by_their_names() {
        for (text, what) in [(&b"<?XML version=\"1.0\"?>"[..], "XML"), (b"\x1f\x8b\x08\x00", "gzip")] {
            let said = check_kind(text).unwrap_err().1.to_string();
            assert!(said.contains(what), "{said}");
        }
        assert!(check_kind(b"[Header]\nt,P1\n0,1\n").is_ok() && check_kind(b"t,P1\n0,1\n").is_ok());
    }

    use super::*;
    use encoding_rs::{BIG5, EUC_KR, GBK, SHIFT_JIS, WINDOWS_1250, WINDOWS_1251};

    fn read(bytes: &[u8], encoding: Option<&str>) -> Result<(String, Vec<Repair>), CsvFault> {
        let encoding = encoding.map(|name| encoding_named(name).unwrap());
        let mut repairs = Vec::new();
        let options = SourceOptions { encoding, ..SourceOptions::default() };
        let text = decode(bytes, &options, &mut repairs)?.into_owned();
        Ok((text, repairs))
    }

    #[test]
    fn headings_in_older_code_pages_are_read_as_what_they_are() {
        let tables = [
            (SHIFT_JIS, "時間(s),圧力1(kPa),弁開度,備考\n0.000,245.1,100,計測開始\n0.001,245.2,100,バルブ閉\n"),
            (SHIFT_JIS, "日付,時刻,圧力\n"),
            (GBK, "时间(s),压力1(kPa),阀门开度\n0.000,245.1,100\n"),
            (WINDOWS_1251, "Время (с);Давление 1 (кПа);Расход\n0,000;245,1;0,5\n"),
            (WINDOWS_1250, "Čas (s);Tlak u ventilu (kPa);Průtok\n0,000;245,1;0,5\nZavření ventilu příliš rychlé\n"),
            (WINDOWS_1252, "Prüfstand 2;Überdruck (mbar);Öffnung\n0,000;245,1;0,5\n"),
            (WINDOWS_1252, "Temps;Débit;Température (°C)\n0,000;245,1;0,5\n"),
            (EUC_KR, "시간(s),압력(kPa),밸브 위치\n0.000,245.1,100\n"),
            (BIG5, "時間(s),壓力(kPa),閥門開度\n0.000,245.1,100\n"),
        ];
        for (encoding, text) in tables {
            let (bytes, ..) = encoding.encode(text);
            let (found, repairs) = read(&bytes, None).unwrap();
            assert_eq!(found, text, "{repairs:?}");
            assert!(repairs[0].what == "encoding" && repairs[0].text.contains(encoding.name()), "{repairs:?}");
            assert_eq!(read(&bytes, Some(encoding.name())).unwrap(), (text.to_owned(), Vec::new()));
        }
    }

    #[test]
    fn letters_may_stand_anywhere_and_numbers_are_read_whatever_the_letters() {
        let mut bytes = "t_s,P1,remark\n".to_owned().into_bytes();
        (0..5000).for_each(|i| bytes.extend(format!("0.{i:04},1.5,\n").bytes()));
        bytes.extend(b"0.5,1.5,valve closed at 20 \xb0C \x96 \xfcber\n");
        let (text, repairs) = read(&bytes, None).unwrap();
        assert!(text.ends_with("20 °C – über\n") && repairs[0].line == Some(5002), "{repairs:?}");
        // what no code page has is still text
        let (text, _) = read(b"t_s,P1 \x81\xff\x81\n0,1.5\n", None).unwrap();
        assert!(text.ends_with("0,1.5\n"), "{text}");
        let image = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\xff\xfe";
        assert!(matches!(*read(image, None).unwrap_err().1, CsvProblem::NotUtf8 { .. }));
    }

    #[test]
    fn utf_16_needs_no_mark() {
        let text = "Zeit (s);Überdruck (bar)\n0,000;1,5\n";
        for big in [false, true] {
            let units = text.encode_utf16().map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() });
            let bytes: Vec<u8> = units.flatten().collect();
            assert_eq!(read(&bytes, None).unwrap().0, text);
            let mark = if big { [0xfe, 0xff] } else { [0xff, 0xfe] };
            assert_eq!(read(&[&mark[..], &bytes].concat(), None).unwrap().0, text);
            assert!(read(&[&mark[..], &bytes[1..]].concat(), None).is_err());
        }
    }

    #[test]
    fn an_encoding_that_is_stated_holds() {
        assert_eq!(read(b"P\xfc\n", Some("cp1251")).unwrap().0, "Pь\n");
        let (line, problem) = read(b"ok\nP\xfc,\n", Some("cp932")).unwrap_err();
        assert!(line == Some(2) && problem.to_string().contains("Shift_JIS"), "{line:?} {problem}");
        for name in [
            "cp932",
            "Shift-JIS",
            "SJIS",
            "cp936",
            "GB2312",
            "CP1250",
            "windows-1252",
            "latin1",
            "ISO-8859-2",
            "utf-16",
            "koi8-r",
        ] {
            encoding_named(name).unwrap();
        }
        assert!(encoding_named("cp9999").unwrap_err().contains("cp932"));
    }

    #[test]
    fn a_line_that_fills_the_memory_is_refused_and_long_files_are_not() {
        let line = vec![b'1'; LONGEST_LINE + 1];
        assert!(matches!(*check_lines(&line).unwrap_err().1, CsvProblem::LongLine { mebibytes: 16 }));
        let mut lines = b"time_s,P1\n".repeat(3 * LONGEST_LINE / 10);
        assert!(check_lines(&lines).is_ok());
        lines.extend(line);
        assert!(check_lines(&lines).is_err());
    }
}
