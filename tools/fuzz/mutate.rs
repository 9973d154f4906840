//! Damaged inputs: bytes and numbers changed, pieces dropped, doubled and taken from other inputs.

use fastrand::Rng;

/// No input grows beyond this.
pub const LONGEST: usize = 1 << 16;

const NUMBERS: [u64; 14] = [
    0,
    1,
    2,
    7,
    0x7f,
    0x80,
    0xff,
    0xffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0x8000_0000_0000_0000,
    u64::MAX,
];
const WORDS: [&str; 30] = [
    "time_s",
    "P1",
    "#",
    ";",
    ",",
    "\t",
    "\n",
    "\r\n",
    "\"",
    "=",
    "[",
    "]]",
    "{",
    "}",
    "e308",
    "-",
    "nan",
    "inf",
    "1e-320",
    "0",
    "99999999999999999999",
    "0.1",
    "2026-03-14T09:26:53.5Z",
    "14.03.2026 09:26:53,5",
    "09:26:53",
    " (bar)",
    "[kPa]",
    "\u{feff}",
    "°",
    "0,5",
];

/// A new input made of those in `queue`; later ones, which led to newer code, more often.
pub fn mutated(queue: &[Vec<u8>], rng: &mut Rng) -> Vec<u8> {
    let recent = rng.usize(0..queue.len()).max(rng.usize(0..queue.len()));
    let mut bytes = queue[recent].clone();
    for _ in 0..1 << rng.u32(0..5) {
        once(&mut bytes, queue, rng);
    }
    bytes.truncate(LONGEST);
    bytes
}

fn once(bytes: &mut Vec<u8>, queue: &[Vec<u8>], rng: &mut Rng) {
    let at = rng.usize(0..=bytes.len());
    let piece = |bytes: &[u8], rng: &mut Rng| {
        let from = rng.usize(0..=bytes.len());
        let most = (bytes.len() - from).min(1 << rng.u32(0..9));
        from..from + rng.usize(0..=most)
    };
    match rng.u8(0..10) {
        0 if at < bytes.len() => bytes[at] ^= 1 << rng.u8(0..8),
        1 if at < bytes.len() => bytes[at] = rng.u8(..),
        2 | 3 => {
            let number = NUMBERS[rng.usize(0..NUMBERS.len())].wrapping_add_signed(rng.i64(-2..=2));
            let width = [1, 2, 4, 8][rng.usize(0..4)];
            let text = if rng.bool() {
                number.to_le_bytes()
            } else {
                number.swap_bytes().rotate_left(8 * width as u32).to_le_bytes()
            };
            let end = (at + width).min(bytes.len());
            bytes[at..end].copy_from_slice(&text[..end - at]);
        }
        4 => {
            bytes.drain(piece(bytes, rng));
        }
        5 => {
            let copy = bytes[piece(bytes, rng)].to_vec();
            bytes.splice(at..at, copy);
        }
        6 => {
            let other = &queue[rng.usize(0..queue.len())];
            let copy = other[piece(other, rng)].to_vec();
            let end = if rng.bool() { at } else { (at + copy.len()).min(bytes.len()) };
            bytes.splice(at..end, copy);
        }
        7 => {
            let word = WORDS[rng.usize(0..WORDS.len())].bytes();
            let end = if rng.bool() { at } else { (at + word.len()).min(bytes.len()) };
            bytes.splice(at..end, word);
        }
        8 => bytes.truncate(at),
        _ => {
            // a number in text becomes another one
            let Some(from) = bytes[at..].iter().position(u8::is_ascii_digit).map(|i| at + i) else { return };
            let to = bytes[from..].iter().position(|b| !b.is_ascii_digit()).map_or(bytes.len(), |i| from + i);
            let number = NUMBERS[rng.usize(0..NUMBERS.len())].to_string();
            bytes.splice(from..to, number.into_bytes());
        }
    }
}
