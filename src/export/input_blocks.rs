//! Samples of a CSV in blocks: a file of any length in bounded memory.
//!
//! A block is some megabytes of whole lines under the file's header. Lines count from the file's
//! beginning.

use std::io::{self, Read};

use super::RayChart;
use super::input::{CsvError, InputSamples, read_part};
use super::repeats::Repeats;

/// Why a file's samples did not all come.
#[derive(Debug, thiserror::Error)]
pub enum BlockError<E> {
    /// The disk, or a pipe that broke.
    #[error("cannot be read: {0}")]
    Read(io::Error),
    /// What stands in the file.
    #[error("{0}")]
    Csv(CsvError),
    /// What was made of a block.
    #[error("{0}")]
    Taken(E),
}

/// Hands the samples of a CSV on, block by block, and their lines with them.
pub fn read_sample_blocks<E>(
    chart: RayChart,
    mut input: impl Read,
    mut take: impl FnMut(InputSamples) -> Result<(), E>,
) -> Result<(), BlockError<E>> {
    let mut text = Vec::new();
    let mut header: Option<Vec<u8>> = None;
    let mut repeats = Repeats::default();
    let (mut passed, mut any, mut ended) = (0, false, false);
    while !ended {
        let room = BLOCK_BYTES.saturating_sub(text.len()) as u64;
        let read = input.by_ref().take(room).read_to_end(&mut text).map_err(BlockError::Read)?;
        ended = (read as u64) < room;
        let end = if ended { Some(text.len()) } else { last_line_end(&text) };
        let Some(end) = end else {
            let detail = format!("a line, or a quoted field, of more than {BLOCK_BYTES} bytes");
            return Err(BlockError::Csv(CsvError::Malformed { line: passed + 1, detail }));
        };
        let rest = text.split_off(end);
        let lines = text.split(|byte| *byte == b'\n').count() as u64 - 1;
        let before = match &header {
            None => read_part(chart, &text, &mut repeats, 0),
            // The header's line stands before the block's first.
            Some(header) => {
                read_part(chart, &[header, &text[..]].concat(), &mut repeats, passed - 1)
                    .map(|samples| samples.later(passed - 1))
                    .map_err(|error| error.later(passed - 1))
            }
        };
        match before {
            Ok(samples) => {
                any = true;
                take(samples).map_err(BlockError::Taken)?;
            }
            // Only comments and empty lines, so far.
            Err(CsvError::NoRows) => {}
            Err(error) => return Err(BlockError::Csv(error)),
        }
        header = header.or_else(|| header_of(&text));
        passed += lines;
        text = rest;
    }
    if any { Ok(()) } else { Err(BlockError::Csv(CsvError::NoRows)) }
}

/// After the last line end that is in no quoted field.
fn last_line_end(text: &[u8]) -> Option<usize> {
    let (mut stands, mut last) = (Stands::AtLine, None);
    for (at, byte) in text.iter().enumerate() {
        stands = stands.after(*byte);
        if *byte == b'\n' && stands == Stands::AtLine {
            last = Some(at + 1);
        }
    }
    last
}

/// Where in a CSV a byte stands: quotes are such at a field's beginning alone, and in comments none is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stands {
    AtLine,
    AtField,
    InField,
    InQuotes,
    /// At the field's end, or between the two quotes that stand for one.
    BehindQuotes,
    InComment,
}

impl Stands {
    const fn after(self, byte: u8) -> Self {
        match (self, byte) {
            (Self::InComment, b'\n') => Self::AtLine,
            (Self::InComment, _) | (Self::AtLine, b'#') => Self::InComment,
            (Self::InQuotes, b'"') => Self::BehindQuotes,
            (Self::InQuotes, _) | (Self::AtLine | Self::AtField | Self::BehindQuotes, b'"') => {
                Self::InQuotes
            }
            (_, b'\n' | b'\r') => Self::AtLine,
            (_, b',') => Self::AtField,
            _ => Self::InField,
        }
    }
}

/// The first line that is neither empty nor a comment, with its end.
fn header_of(text: &[u8]) -> Option<Vec<u8>> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let mut lines = text.split_inclusive(|byte| *byte == b'\n');
    lines.find(|line| !line.starts_with(b"#") && !line.trim_ascii().is_empty()).map(<[u8]>::to_vec)
}

/// 30,000 samples or so; tests need not be long.
const BLOCK_BYTES: usize = if cfg!(test) { 200 } else { 4 << 20 };

#[cfg(test)]
mod tests {
    use super::super::read_samples;
    use super::*;

    const HEADER: &str = "x_mm,y_mm,theta_deg,phi_deg,radiance_w_per_m2_sr,note\n";

    fn text(rows: usize) -> String {
        let row = |i: usize| format!("0,0,{},{},1.5,\"a\nb\"\n# a comment\n\n", i % 90, i % 7);
        format!("# ours\n{HEADER}{}", (0..rows).map(row).collect::<String>())
    }

    fn read(text: &str) -> Result<Vec<super::super::InputSample>, BlockError<String>> {
        let mut all = Vec::new();
        read_sample_blocks(RayChart::Surface, text.as_bytes(), |block| {
            all.extend(block.samples);
            Ok::<(), String>(())
        })
        .map(|()| all)
    }

    #[test]
    fn blocks_hold_what_the_whole_does_with_its_lines() {
        for rows in [1, 40] {
            let text = text(rows);
            assert!(rows == 1 || text.len() > 5 * BLOCK_BYTES);
            assert_eq!(read(&text).unwrap(), read_samples(text.as_bytes()).unwrap().samples);
        }
    }

    #[test]
    fn a_quote_in_a_comment_or_amid_a_field_opens_nothing() {
        let rows: Vec<String> = (0..40).map(|i| format!("0,0,{i},0,1.5,\n")).collect();
        let rows = rows.concat();
        for odd in ["# 5\" across\n", "0,0,1,1,1.5,5\" across\n", "0,0,1,1,1.5,\"5\"\" across\"\n"]
        {
            let text = format!("# a lamp of 2\"\n{HEADER}{odd}{rows}{odd}");
            let text = text.trim_end_matches(if odd.starts_with('#') { "" } else { odd });
            assert!(text.len() > 3 * BLOCK_BYTES);
            assert_eq!(read(text).unwrap(), read_samples(text.as_bytes()).unwrap().samples);
        }
    }

    #[test]
    fn what_is_wrong_far_down_is_named_with_its_line() {
        let wrong = format!("{}0,0,91,0,1,\n", text(40));
        let expected = read_samples(wrong.as_bytes()).unwrap_err().to_string();
        assert!(expected.starts_with("line 1"), "{expected}");
        assert_eq!(read(&wrong).unwrap_err().to_string(), expected);
        let twice = format!("{}0,0,3,3,1.5,\"a\nb\"\n", text(40));
        let expected = read_samples(twice.as_bytes()).unwrap_err().to_string();
        assert!(expected.contains("repeats line 15 in every field"), "{expected}");
        assert_eq!(read(&twice).unwrap_err().to_string(), expected);
        let short = format!("{}0,0\n", text(40));
        let expected = read_samples(short.as_bytes()).unwrap_err().to_string();
        assert_eq!(read(&short).unwrap_err().to_string(), expected);
        assert!(read(HEADER).unwrap_err().to_string().contains("no rows"));
        let long = format!("{HEADER}0,0,0,0,1,\"{}", "x\n".repeat(300));
        assert!(read(&long).unwrap_err().to_string().contains("more than 200 bytes"));
    }
}
