//! The `resources/` folder from what hosts pass as its location.
//!
//! The standard wants a URI (RFC 3986), `file:///dir/resources`. In the field one meets `file:/dir`,
//! `file://localhost/dir`, `file://C:/dir`, `/C:/dir`, unencoded spaces, plain paths, trailing slashes and NULL.

use std::path::{Path, PathBuf};

/// Reasons for which a location cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum ResourceError {
    #[error("the resource location `{0}` is no file URI: use file:///FOLDER")]
    Scheme(String),
    #[error("the resource location `{location}` names the machine `{host}`: only local folders can be read")]
    RemoteHost { location: String, host: String },
    #[error("the resource location `{0}` is not UTF-8 after decoding")]
    NotUtf8(String),
}

/// The folder behind a resource location, `None` where the host gave none.
///
/// `exists` tells whether a folder is there: it decides only where a host forgot to encode a `%`.
///
/// # Errors
/// Another scheme than `file`, another machine, bytes that are not UTF-8.
pub fn folder(location: &str, exists: impl Fn(&Path) -> bool) -> Result<Option<PathBuf>, ResourceError> {
    let location = location.trim();
    if location.is_empty() {
        return Ok(None);
    }
    let Some((scheme, rest)) = split_scheme(location) else {
        return Ok(Some(clean(location)));
    };
    if !scheme.eq_ignore_ascii_case("file") {
        return Err(ResourceError::Scheme(location.to_owned()));
    }
    let path = match rest.strip_prefix("//") {
        None => rest,
        Some(rest) if rest.starts_with('/') || is_drive(rest) => rest,
        Some(rest) => {
            let (host, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
            if !host.eq_ignore_ascii_case("localhost") {
                return Err(ResourceError::RemoteHost {
                    location: location.to_owned(),
                    host: host.to_owned(),
                });
            }
            path
        }
    };
    let decoded = decode(path).ok_or_else(|| ResourceError::NotUtf8(location.to_owned()))?;
    let (literal, decoded) = (clean(path), clean(&decoded));
    let folder = if literal != decoded && !exists(&decoded) && exists(&literal) { literal } else { decoded };
    Ok(Some(folder))
}

/// Splits `scheme:rest`. One letter is no scheme but a drive.
fn split_scheme(location: &str) -> Option<(&str, &str)> {
    let (scheme, rest) = location.split_once(':')?;
    let valid = scheme.len() > 1
        && scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.'));
    valid.then_some((scheme, rest))
}

/// True if a path begins with a Windows drive, `C:` followed by nothing or a slash.
fn is_drive(path: &str) -> bool {
    let bytes = path.as_bytes();
    bytes.len() >= 2
        && bytes[0].is_ascii_alphabetic()
        && bytes[1] == b':'
        && bytes.get(2).is_none_or(|next| matches!(next, b'/' | b'\\'))
}

/// Takes off the slash before a drive and the one at the end.
fn clean(path: &str) -> PathBuf {
    let path = path.strip_prefix('/').filter(|rest| is_drive(rest)).unwrap_or(path);
    let trimmed = path.trim_end_matches(['/', '\\']);
    if trimmed.is_empty() { PathBuf::from("/") } else { PathBuf::from(trimmed) }
}

/// Percent-decoding; a `%` without two hexadecimal digits stands for itself. `None` if the result is not UTF-8.
fn decode(text: &str) -> Option<String> {
    let bytes = text.as_bytes();
    let digit = |i: usize| bytes.get(i).and_then(|byte| char::from(*byte).to_digit(16));
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut i = 0;
    while i < bytes.len() {
        match (bytes[i], digit(i + 1), digit(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                i += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                i += 1;
            }
        }
    }
    String::from_utf8(decoded).ok()
}
