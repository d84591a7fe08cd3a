//! Bytes of a file to text: UTF-8, UTF-16 and UTF-32 of either byte order, with a byte order mark or without, and lines that end
//! with a carriage return alone.

/// Encoding of a text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// UTF-8, or Latin-1 where it is none.
    Bytes,
    /// UTF-16 or UTF-32: bytes of a unit, low or high byte first.
    Wide { width: usize, low_first: bool },
}

impl Encoding {
    /// The encoding of a text that begins so, and the bytes of its mark.
    pub fn of(first: &[u8]) -> (Self, usize) {
        let wide = |width, low_first| Encoding::Wide { width, low_first };
        match first {
            [0xef, 0xbb, 0xbf, ..] => (Encoding::Bytes, 3),
            // The mark of UTF-32 begins like that of UTF-16.
            [0xff, 0xfe, 0, 0, ..] => (wide(4, true), 4),
            [0, 0, 0xfe, 0xff, ..] => (wide(4, false), 4),
            [0xff, 0xfe, ..] => (wide(2, true), 2),
            [0xfe, 0xff, ..] => (wide(2, false), 2),
            // Without a mark: a text begins with two letters of ASCII.
            [a, 0, 0, 0, b, 0, 0, 0, ..] if *a != 0 && *b != 0 => (wide(4, true), 0),
            [0, 0, 0, a, 0, 0, 0, b, ..] if *a != 0 && *b != 0 => (wide(4, false), 0),
            [a, 0, b, 0, ..] if *a != 0 && *b != 0 => (wide(2, true), 0),
            [0, a, 0, b, ..] if *a != 0 && *b != 0 => (wide(2, false), 0),
            _ => (Encoding::Bytes, 0),
        }
    }

    /// Bytes as text, and whether they were taken as Latin-1.
    pub fn decode(self, bytes: Vec<u8>) -> (String, bool) {
        let Encoding::Wide { width, low_first } = self else {
            return match String::from_utf8(bytes) {
                Ok(text) => (text, false),
                Err(error) => (error.as_bytes().iter().map(|&byte| char::from(byte)).collect(), true),
            };
        };
        let units = bytes.chunks_exact(width).map(|unit| number(unit, low_first));
        let known = |letter: Option<char>| letter.unwrap_or(char::REPLACEMENT_CHARACTER);
        let text = if width == 2 {
            char::decode_utf16(units.map(|unit| unit as u16)).map(|letter| known(letter.ok())).collect()
        } else {
            units.map(|unit| known(char::from_u32(unit))).collect()
        };
        (text, false)
    }
}

/// The number that a unit's bytes are.
pub(crate) fn number(unit: &[u8], low_first: bool) -> u32 {
    let append = |sum: u32, byte: &u8| (sum << 8) | u32::from(*byte);
    if low_first { unit.iter().rev().fold(0, append) } else { unit.iter().fold(0, append) }
}

/// A whole text with lines that end with `\n`.
///
/// # Errors
/// No text of these encodings: as Latin-1, or without the half of a letter at its end.
pub(crate) fn decode(mut bytes: Vec<u8>) -> Result<String, String> {
    let (encoding, mark) = Encoding::of(&bytes);
    bytes.drain(..mark);
    let cut = matches!(encoding, Encoding::Wide { width, .. } if !bytes.len().is_multiple_of(width));
    let (text, latin1) = encoding.decode(bytes);
    // As programs wrote them on a Mac once, and some devices do.
    let text = if text.contains('\n') { text } else { text.replace('\r', "\n") };
    if latin1 || cut { Err(text) } else { Ok(text) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_the_same_in_any_encoding() {
        let text = "[tyre]\nK = 1.5\nµ";
        let wide16 = |low: bool| {
            let bytes = |unit: u16| if low { unit.to_le_bytes() } else { unit.to_be_bytes() };
            text.encode_utf16().flat_map(bytes).collect::<Vec<_>>()
        };
        let wide32 = |low: bool| {
            let bytes = |letter| if low { u32::to_le_bytes(letter) } else { u32::to_be_bytes(letter) };
            text.chars().flat_map(|letter| bytes(u32::from(letter))).collect::<Vec<_>>()
        };
        let marked = |mark: &[u8], bytes: &[u8]| [mark, bytes].concat();
        for bytes in [
            text.as_bytes().to_vec(),
            marked(&[0xef, 0xbb, 0xbf], text.as_bytes()),
            text.replace('\n', "\r").into_bytes(),
            wide16(true),
            wide16(false),
            marked(&[0xff, 0xfe], &wide16(true)),
            marked(&[0xfe, 0xff], &wide16(false)),
            wide32(true),
            wide32(false),
            marked(&[0xff, 0xfe, 0, 0], &wide32(true)),
            marked(&[0, 0, 0xfe, 0xff], &wide32(false)),
        ] {
            assert_eq!(decode(bytes), Ok(text.to_owned()));
        }
        assert_eq!(decode(b"K = 1 \xb5\n".to_vec()), Err("K = 1 \u{b5}\n".to_owned()));
        assert_eq!(decode(vec![0xff, 0xfe, 0x4b, 0, 0x20]), Err("K".to_owned()));
        assert_eq!(decode(Vec::new()), Ok(String::new()));
    }
}
