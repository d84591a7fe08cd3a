//! Model files by their parts: `KIND 1 HEAD NUMBERS CHECKSUM`, a line break, the head, the numbers.

/// The checksum as documented: FNV-1a, 64 bits.
pub fn fnv(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &b| (hash ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3))
}

/// A file with a first line that fits its body, so that damage reaches what lies behind the checksum.
pub fn sealed(kind: &str, head: &[u8], numbers: &[u8]) -> Vec<u8> {
    let body = [head, numbers].concat();
    let line = format!("{kind} 1 {} {} {:016x}\n", head.len(), numbers.len(), fnv(&body));
    [line.as_bytes(), &body].concat()
}

/// Head and numbers of a file; of a damaged one what may be they, if there is a first line.
pub fn parts(file: &[u8]) -> Option<(&[u8], &[u8])> {
    let end = file.iter().position(|&b| b == b'\n')?;
    let line = String::from_utf8_lossy(&file[..end]);
    let head: usize = line.split(' ').nth(2).and_then(|text| text.parse().ok()).unwrap_or(0);
    let body = &file[end + 1..];
    Some(body.split_at(head.min(body.len())))
}
