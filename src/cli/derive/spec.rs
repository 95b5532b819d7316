//! What `--derive` is given: a short text, or a file of `[[derive]]` tables. Knows no quantity: what
//! a table means is the plan's to read.

use std::fmt::Write as _;
use std::path::Path;

use spanned_toml::{Document, Source};

use crate::cli::failure::Failure;
use crate::plan::Wanted;

/// Reads every SPEC, over a hemisphere of directions or all round: a file if its name ends in .toml, else `KIND KEY=VALUE ...`.
pub(crate) fn wanted(specs: &[String], all_round: bool) -> Result<Vec<Wanted>, Failure> {
    let mut all = Vec::new();
    for spec in specs {
        let path = Path::new(spec);
        if path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml")) {
            all.extend(from_file(path, all_round)?);
        } else {
            let document = Document::parse(Source::new("--derive", &toml_of(spec)?))?;
            let root = document.root();
            all.extend(Wanted::read(&root, all_round)?);
            root.finish()?;
        }
    }
    Ok(all)
}

fn from_file(path: &Path, all_round: bool) -> Result<Vec<Wanted>, Failure> {
    let document = Document::parse(Source::read(path)?)?;
    let root = document.root();
    let wanted = Wanted::read_all(&root, all_round)?;
    root.finish()?;
    if wanted.is_empty() {
        let what = format!("{}: asks for nothing; expected [[derive]] tables", path.display());
        return Err(Failure::with_help(what, "add [[derive]] and kind = \"flux\", for example"));
    }
    Ok(wanted)
}

/// The short form as the lines of a file: `intensity theta_deg=30` is `kind = "intensity"` and
/// `theta_deg = 30`. A list may be written `0,0,500`, and a word without quotes.
fn toml_of(spec: &str) -> Result<String, Failure> {
    let words = words(spec);
    let Some((kind, keys)) = words.split_first() else {
        let what = "--derive: found nothing; expected a kind and its keys, or a file";
        return Err(Failure::with_help(
            what,
            "for example --derive \"intensity theta_deg=30 phi_deg=0\"",
        ));
    };
    let mut text = format!("kind = {}\n", value_of(kind));
    for word in keys {
        let Some((key, value)) = word.split_once('=').filter(|(key, _)| !key.is_empty()) else {
            let what = format!("--derive \"{spec}\": found {word:?}; expected KEY=VALUE");
            return Err(Failure::with_help(what, "write theta_deg=30 without spaces about the ="));
        };
        // Writing to a string does not fail.
        let _ = writeln!(text, "{key} = {}", value_of(value));
    }
    Ok(text)
}

/// Words between spaces; brackets and quotes hold theirs together.
fn words(spec: &str) -> Vec<String> {
    let (mut words, mut word, mut depth, mut quote) = (Vec::new(), String::new(), 0_u32, None);
    for c in spec.chars() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (None, '"' | '\'') => quote = Some(c),
            (None, '[' | '{') => depth += 1,
            (None, ']' | '}') => depth = depth.saturating_sub(1),
            (None, c) if c.is_whitespace() && depth == 0 => {
                if !word.is_empty() {
                    words.push(std::mem::take(&mut word));
                }
                continue;
            }
            _ => {}
        }
        word.push(c);
    }
    if !word.is_empty() {
        words.push(word);
    }
    words
}

fn value_of(value: &str) -> String {
    let is_written = value.starts_with(['[', '{', '"', '\'']) || value.parse::<f64>().is_ok();
    if is_written || value == "true" || value == "false" {
        value.to_owned()
    } else if value.contains(',') {
        format!("[{value}]")
    } else {
        format!("{value:?}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_short_form_is_the_lines_of_a_file() {
        let text = toml_of("irradiance at_mm=0,0,500 normal=[0, 0, -1] name=desk").unwrap();
        let expected =
            "kind = \"irradiance\"\nat_mm = [0,0,500]\nnormal = [0, 0, -1]\nname = \"desk\"\n";
        assert_eq!(text, expected);
        let text =
            toml_of("flux window={index = 1.5, thickness_mm = 4} theta_max_deg=6e1").unwrap();
        assert!(text.contains("window = {index = 1.5, thickness_mm = 4}\ntheta_max_deg = 6e1"));
        assert_eq!(
            wanted(&["flux window.index=1.5 window.thickness_mm=4".to_owned()], false)
                .unwrap()
                .len(),
            1
        );
        assert!(toml_of("  ").is_err() && toml_of("flux theta").is_err());
    }
}
