//! Words of a Netpbm head: parted by white space, `#` to the line's end being a remark. It does not
//! know what they say.

use super::NetpbmError;

/// No number of a head is longer.
const DIGITS_MAX: usize = 12;

pub(super) struct Scanner<'b> {
    bytes: &'b [u8],
    at: usize,
}

impl<'b> Scanner<'b> {
    pub(super) fn new(bytes: &'b [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Whether nothing but space and remarks is left.
    pub(super) fn is_at_end(&mut self) -> bool {
        self.skip_space();
        self.at >= self.bytes.len()
    }

    pub(super) fn word(&mut self) -> Option<&'b [u8]> {
        self.skip_space();
        let rest = self.bytes.get(self.at..)?;
        let ends = |byte: &u8| byte.is_ascii_whitespace() || *byte == b'#';
        let length = rest.iter().position(ends).unwrap_or(rest.len());
        self.at += length;
        (length > 0).then(|| &rest[..length])
    }

    pub(super) fn integer(&mut self, what: &'static str) -> Result<usize, NetpbmError> {
        self.parsed(what)
    }

    /// A finite number.
    pub(super) fn number(&mut self, what: &'static str) -> Result<f64, NetpbmError> {
        let byte = self.at;
        let number: f64 = self.parsed(what)?;
        if number.is_finite() { Ok(number) } else { Err(NetpbmError::Number { what, byte }) }
    }

    /// What stands behind the single space that ends a head.
    pub(super) fn after_one_space(&mut self) -> Result<&'b [u8], NetpbmError> {
        let what = "one space, then the pixels";
        let space = self.bytes.get(self.at).filter(|byte| byte.is_ascii_whitespace());
        space.ok_or(NetpbmError::Number { what, byte: self.at })?;
        Ok(&self.bytes[self.at + 1..])
    }

    fn parsed<T: core::str::FromStr>(&mut self, what: &'static str) -> Result<T, NetpbmError> {
        self.skip_space();
        let byte = self.at;
        let word = self.word().filter(|word| word.len() <= DIGITS_MAX);
        let text = word.and_then(|word| core::str::from_utf8(word).ok());
        text.and_then(|text| text.parse().ok()).ok_or(NetpbmError::Number { what, byte })
    }

    fn skip_space(&mut self) {
        let mut is_remark = false;
        while let Some(byte) = self.bytes.get(self.at) {
            match byte {
                b'\n' | b'\r' => is_remark = false,
                b'#' => is_remark = true,
                _ => {}
            }
            if !is_remark && !byte.is_ascii_whitespace() {
                break;
            }
            self.at += 1;
        }
    }
}
