//! Grey images in the Netpbm family: PGM (`P2` as text, `P5` of 8 or 16 bits) and PFM (`Pf`, 32-bit
//! floats of either byte order), as cameras and renderers write them.
//!
//! A pixel of a PGM is its part of the file's greatest value; one of a PFM is the number that stands
//! there. No value is gamma-corrected: the caller says what one is worth. Colour, of which a
//! radiometer knows nothing, is refused.
//!
//! ```
//! let image = photometry_files::netpbm::read(b"P2 2 1 100\n25 100\n")?;
//! assert_eq!((image.width(), image.height()), (2, 1));
//! assert_eq!(image.values(), [0.25, 1.0]);
//! # Ok::<(), photometry_files::netpbm::NetpbmError>(())
//! ```

mod error;
mod scan;

pub use error::NetpbmError;

use scan::Scanner;

/// The most pixels of an image: 16 million. A gantry's spot resolves far fewer.
pub const PIXELS_MAX: usize = 1 << 24;

/// Rows of values, the top row first.
#[derive(Debug, Clone, PartialEq)]
pub struct GreyImage {
    width: usize,
    values: Vec<f64>,
}

impl GreyImage {
    /// Pixels in a row; at least 1.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows; at least 1.
    pub fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// Row by row from the top, each from the left; finite and at least 0.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// The same, handed over.
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }
}

/// Reads an image from the whole bytes of its file.
pub fn read(bytes: &[u8]) -> Result<GreyImage, NetpbmError> {
    let mut scanner = Scanner::new(bytes);
    let magic = scanner.word().unwrap_or_default();
    match magic {
        b"P2" => read_text(scanner),
        b"P5" => read_binary(scanner),
        b"Pf" => read_floats(scanner),
        b"P3" | b"P6" | b"PF" => Err(NetpbmError::Colour),
        _ => Err(NetpbmError::Magic),
    }
}

fn read_size(scanner: &mut Scanner<'_>) -> Result<(usize, usize), NetpbmError> {
    let width = scanner.integer("the width")?;
    let height = scanner.integer("the height")?;
    if width == 0 || height == 0 {
        return Err(NetpbmError::Empty { width, height });
    }
    if width.checked_mul(height).is_none_or(|pixels| pixels > PIXELS_MAX) {
        return Err(NetpbmError::TooLarge { width, height });
    }
    Ok((width, height))
}

/// Size and greatest value of a PGM.
fn read_grey_head(scanner: &mut Scanner<'_>) -> Result<(usize, usize, usize), NetpbmError> {
    let (width, height) = read_size(scanner)?;
    let greatest = scanner.integer("the greatest value")?;
    if (1..=65_535).contains(&greatest) {
        Ok((width, height, greatest))
    } else {
        Err(NetpbmError::Greatest(greatest))
    }
}

fn grey(value: usize, greatest: usize, pixel: usize) -> Result<f64, NetpbmError> {
    if value > greatest {
        return Err(NetpbmError::Pixel { pixel, value: value as f64 });
    }
    Ok(value as f64 / greatest as f64)
}

fn read_text(mut scanner: Scanner<'_>) -> Result<GreyImage, NetpbmError> {
    let (width, height, greatest) = read_grey_head(&mut scanner)?;
    let mut values = Vec::with_capacity(width * height);
    for pixel in 0..width * height {
        if scanner.is_at_end() {
            return Err(NetpbmError::Short { found: pixel, expected: width * height });
        }
        values.push(grey(scanner.integer("a pixel")?, greatest, pixel)?);
    }
    if !scanner.is_at_end() {
        return Err(NetpbmError::Long { expected: width * height });
    }
    Ok(GreyImage { width, values })
}

fn read_binary(mut scanner: Scanner<'_>) -> Result<GreyImage, NetpbmError> {
    let (width, height, greatest) = read_grey_head(&mut scanner)?;
    let bytes_each = if greatest < 256 { 1 } else { 2 };
    let raster = raster(&mut scanner, width * height, bytes_each)?;
    let values = raster.chunks_exact(bytes_each).enumerate().map(|(pixel, bytes)| {
        let value = bytes.iter().fold(0, |value, byte| value << 8 | usize::from(*byte));
        grey(value, greatest, pixel)
    });
    Ok(GreyImage { width, values: values.collect::<Result<_, _>>()? })
}

/// A PFM stores its rows from the bottom up; its scale's sign is the byte order.
fn read_floats(mut scanner: Scanner<'_>) -> Result<GreyImage, NetpbmError> {
    let (width, height) = read_size(&mut scanner)?;
    let scale = scanner.number("the scale")?;
    if scale == 0.0 {
        return Err(NetpbmError::Scale);
    }
    let raster = raster(&mut scanner, width * height, 4)?;
    let mut values = Vec::with_capacity(width * height);
    for (row, bytes) in raster.chunks_exact(4 * width).rev().enumerate() {
        for (column, bytes) in bytes.chunks_exact(4).enumerate() {
            let bytes = [bytes[0], bytes[1], bytes[2], bytes[3]];
            let value =
                if scale < 0.0 { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) };
            if !value.is_finite() || value < 0.0 {
                let pixel = row * width + column;
                return Err(NetpbmError::Pixel { pixel, value: f64::from(value) });
            }
            values.push(f64::from(value));
        }
    }
    Ok(GreyImage { width, values })
}

/// The bytes behind the one character that ends the head: exactly as many as there are pixels.
fn raster<'b>(
    scanner: &mut Scanner<'b>,
    pixels: usize,
    bytes_each: usize,
) -> Result<&'b [u8], NetpbmError> {
    let rest = scanner.after_one_space()?;
    if rest.len() < pixels * bytes_each {
        return Err(NetpbmError::Short { found: rest.len() / bytes_each, expected: pixels });
    }
    if rest.len() > pixels * bytes_each {
        return Err(NetpbmError::Long { expected: pixels });
    }
    Ok(rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_picture_is_read_from_every_format() {
        let text = read(b"P2\n# by hand\n2 2\n4 # greatest\n0 1\n2 4\n").unwrap();
        assert_eq!(text.values(), [0.0, 0.25, 0.5, 1.0]);
        assert_eq!(read(b"P5 2 2 4\n\x00\x01\x02\x04").unwrap(), text);
        let wide = read(b"P5 2 2 400\n\x00\x00\x00\x64\x00\xc8\x01\x90").unwrap();
        assert_eq!(wide, text);
        let floats = |order: fn(f32) -> [u8; 4], scale: &str| {
            let mut bytes = format!("Pf\n2 2\n{scale}\n").into_bytes();
            // From the bottom up.
            for value in [0.5, 1.0, 0.0, 0.25] {
                bytes.extend(order(value));
            }
            read(&bytes).unwrap()
        };
        assert_eq!(floats(f32::to_le_bytes, "-1.0"), text);
        assert_eq!(floats(f32::to_be_bytes, "1.0"), text);
    }

    #[test]
    fn what_is_cut_short_ragged_or_no_grey_image_is_refused() {
        let cases: [(&[u8], &str); 14] = [
            (b"", "P2, P5 or Pf"),
            (b"\x89PNG\r\n", "P2, P5 or Pf"),
            (b"P6 1 1 255\nabc", "colour"),
            (b"P2 2", "the height"),
            (b"P2 0 2 4\n", "0 x 2"),
            (b"P2 100000 100000 4\n", "16777216"),
            (b"P2 1 1 70000\n1", "70000"),
            (b"P2 2 2 4\n0 1 2", "3 of 4 pixels"),
            (b"P2 2 1 4\n0 1 2", "more than its 2 pixels"),
            (b"P2 2 1 4\n0 x", "a pixel"),
            (b"P2 2 1 4\n0 5", "pixel 1"),
            (b"P5 2 1 255\n\x01", "1 of 2 pixels"),
            (b"P5 2 1 255\n\x01\x02\x03", "more than its 2 pixels"),
            (b"Pf 1 1 -1\n\x00\x00\xc0\x7f", "pixel 0"),
        ];
        for (bytes, why) in cases {
            let error = read(bytes).expect_err(why).to_string();
            assert!(error.contains(why), "{error:?} does not say {why:?}");
        }
    }
}
