//! FNV-1a, 64 bits: tells files and data sets apart, and finds damage. It is no protection against forgery.

/// A hash being made.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fnv(u64);

impl Fnv {
    pub fn new() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }

    pub fn add(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }

    pub fn value(self) -> u64 {
        self.0
    }
}

/// The hash of some bytes.
#[must_use]
pub fn fnv(bytes: &[u8]) -> u64 {
    let mut hash = Fnv::new();
    hash.add(bytes);
    hash.value()
}

#[cfg(test)]
mod tests {
    #[test]
    fn gives_the_published_number() {
        assert_eq!(super::fnv(b"foobar"), 0x8594_4171_f739_67e8);
    }
}
