//! A stream of bytes to the pieces between its end marks, in any split of the stream; without any I/O.

/// Cuts a stream behind each byte `END`. A piece longer than `LONGEST` bytes is not kept, so memory stays bounded.
#[derive(Debug, Default)]
pub(crate) struct Pieces<const END: u8, const LONGEST: usize> {
    pending: Vec<u8>,
    ended: Vec<u8>,
    /// The rest of an overlong piece is thrown away up to the next end mark.
    skipping: bool,
    /// The first end mark was seen; what stood before it may be the rest of a piece that began before we listened, or
    /// no piece at all.
    aligned: bool,
    /// When the first byte of the pending piece arrived.
    began_ns: i64,
}

/// What stood before an end mark.
pub(crate) struct Piece<'a> {
    /// Its bytes, without the end mark; `None` for an overlong one.
    pub bytes: Option<&'a [u8]>,
    /// It is the first: it may be the rest of a piece that began before we listened.
    pub maybe_rest: bool,
    /// When its first byte arrived, ns on the clock of [`Pieces::next`].
    pub began_ns: i64,
}

impl<const END: u8, const LONGEST: usize> Pieces<END, LONGEST> {
    /// Takes from `bytes`, which arrived at `at_ns`, up to the next end mark; `None` once all are taken and the piece
    /// goes on.
    pub fn next(&mut self, at_ns: i64, bytes: &mut &[u8]) -> Option<Piece<'_>> {
        let Some(length) = bytes.iter().position(|&byte| byte == END) else {
            self.keep(at_ns, std::mem::take(bytes));
            return None;
        };
        let (piece, rest) = bytes.split_at(length);
        *bytes = &rest[1..];
        self.keep(at_ns, piece);
        std::mem::swap(&mut self.pending, &mut self.ended);
        self.pending.clear();
        let overlong = std::mem::take(&mut self.skipping);
        let maybe_rest = !std::mem::replace(&mut self.aligned, true);
        Some(Piece { bytes: (!overlong).then_some(&self.ended), maybe_rest, began_ns: self.began_ns })
    }

    /// The stream was cut off, and what comes next may begin within a piece. True where a piece that had begun was cut
    /// with it.
    pub fn cut(&mut self) -> bool {
        let within = self.aligned && (self.skipping || !self.pending.is_empty());
        self.pending.clear();
        (self.skipping, self.aligned) = (false, false);
        within
    }

    fn keep(&mut self, at_ns: i64, part: &[u8]) {
        if self.skipping {
            return;
        }
        if self.pending.is_empty() {
            self.began_ns = at_ns;
        }
        if self.pending.len() + part.len() > LONGEST {
            self.skipping = true;
            self.pending.clear();
        } else {
            self.pending.extend_from_slice(part);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Cut = (Option<String>, bool, i64);

    fn feed(pieces: &mut Pieces<b'\n', 4>, at_ns: i64, text: &str) -> Vec<Cut> {
        let (mut rest, mut cut) = (text.as_bytes(), Vec::new());
        while let Some(piece) = pieces.next(at_ns, &mut rest) {
            let text = piece.bytes.map(|bytes| String::from_utf8(bytes.to_vec()).unwrap());
            cut.push((text, piece.maybe_rest, piece.began_ns));
        }
        assert!(rest.is_empty());
        cut
    }

    #[test]
    fn pieces_know_when_they_began_and_whether_they_are_whole() {
        let mut pieces = Pieces::default();
        assert_eq!(feed(&mut pieces, 1, "ab"), []);
        assert_eq!(
            feed(&mut pieces, 2, "c\nd\n\ne"),
            [(Some("abc".into()), true, 1), (Some("d".into()), false, 2), (Some(String::new()), false, 2)]
        );
        assert_eq!(feed(&mut pieces, 3, "f\n"), [(Some("ef".into()), false, 2)]);
    }

    #[test]
    fn an_overlong_piece_costs_itself_and_no_memory() {
        let mut pieces = Pieces::default();
        assert_eq!(feed(&mut pieces, 1, "\n"), [(Some(String::new()), true, 1)]);
        for _ in 0..100 {
            assert_eq!(feed(&mut pieces, 2, "aaa"), []);
        }
        assert!(pieces.pending.capacity() < 64);
        assert_eq!(feed(&mut pieces, 3, "a\nabcd\n"), [(None, false, 2), (Some("abcd".into()), false, 3)]);
    }

    #[test]
    fn a_cut_within_a_piece_is_told_once_the_stream_is_aligned() {
        let mut pieces = Pieces::default();
        feed(&mut pieces, 1, "ab");
        assert!(!pieces.cut(), "what stood there may have been the rest of anything");
        feed(&mut pieces, 2, "ab\n");
        assert!(!pieces.cut(), "nothing had begun");
        feed(&mut pieces, 3, "\na");
        assert!(pieces.cut());
        assert_eq!(feed(&mut pieces, 4, "b\n"), [(Some("b".into()), true, 4)]);
    }
}
