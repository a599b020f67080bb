//! Interprets the bytes of a case: as numbers, choices, edits of texts.

/// The bytes still to be read; zeros after the end.
pub(crate) struct Bytes<'a> {
    rest: &'a [u8],
}

impl<'a> Bytes<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        let (first, rest) = self.rest.split_first().unwrap_or((&0, &[]));
        self.rest = rest;
        *first
    }

    /// A number below `n`, which is at most 65536 and not 0.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        let high = if n > 256 { usize::from(self.byte()) << 8 } else { 0 };
        (high | usize::from(self.byte())) % n
    }

    /// A position in something of `n` bytes; 0 for an empty one.
    pub(crate) fn position(&mut self, n: usize) -> usize {
        let wide = (0..4).fold(0, |sum, _| sum << 8 | usize::from(self.byte()));
        wide % n.max(1)
    }

    pub(crate) fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }

    /// A number of moderate size.
    pub(crate) fn moderate(&mut self) -> f64 {
        f64::from(i16::from_le_bytes([self.byte(), self.byte()])) / 256.0
    }

    /// Any number.
    pub(crate) fn number(&mut self) -> f64 {
        const ODD: [f64; 12] = [
            0.0,
            -0.0,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            5e-324,
            1e300,
            -1e300,
            f64::MAX,
            f64::EPSILON,
            1e-9,
            1e9,
        ];
        match self.byte() % 32 {
            k @ 0..12 => ODD[usize::from(k)],
            12..15 => f64::from_le_bytes(std::array::from_fn(|_| self.byte())),
            _ => self.moderate(),
        }
    }

    /// `text` with up to four edits, of bytes, lines and words; `words` are put in or in place of others.
    pub(crate) fn edited(&mut self, text: &[u8], words: &[&str]) -> Vec<u8> {
        let mut text = text.to_vec();
        for _ in 0..1 + self.below(4) {
            let at = self.position(text.len());
            match self.below(12) {
                0 if !text.is_empty() => text[at] = self.byte(),
                1 if !text.is_empty() => text[at] ^= 1 << self.below(8),
                2 => text.truncate(at),
                3 => {
                    let end = (at + self.below(40)).min(text.len());
                    text.drain(at..end);
                }
                4 => {
                    let (begin, end) = line(&text, at);
                    let copy = text[begin..end].to_vec();
                    let to = line(&text, self.position(text.len())).0;
                    text.splice(to..to, copy);
                }
                5 => {
                    let word = self.pick(words).bytes();
                    text.splice(at..at, word);
                }
                _ => {
                    let (begin, end) = word(&text, at);
                    let replacement = self.replacement(words);
                    text.splice(begin..end, replacement);
                }
            }
        }
        text
    }

    fn replacement(&mut self, words: &[&str]) -> Vec<u8> {
        match self.below(4) {
            0 => format!("{:?}", self.number()).to_lowercase().into_bytes(),
            1 => self.pick(&["0", "-1", "4294967296", "18446744073709551616", "1e999", "\"\""]).into(),
            _ => self.pick(words).into(),
        }
    }
}

/// The line around `at`, with its end.
fn line(text: &[u8], at: usize) -> (usize, usize) {
    let begin = text[..at].iter().rposition(|b| *b == b'\n').map_or(0, |n| n + 1);
    let end = text[at..].iter().position(|b| *b == b'\n').map_or(text.len(), |n| at + n + 1);
    (begin, end)
}

/// The word or number around or after `at`.
fn word(text: &[u8], at: usize) -> (usize, usize) {
    let part = |b: &u8| b.is_ascii_alphanumeric() || b"_.-+".contains(b);
    let at = text[at..].iter().position(part).map_or(text.len(), |n| at + n);
    let begin = text[..at].iter().rposition(|b| !part(b)).map_or(0, |n| n + 1);
    let end = text[at..].iter().position(|b| !part(b)).map_or(text.len(), |n| at + n);
    (begin, end)
}
