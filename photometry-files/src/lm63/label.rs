//! The part of the file before the numbers: edition, keywords, and the unit of intensity that they
//! state. The standard knows candela only; radiometric files say otherwise here.

use std::fmt;

use super::error::{Problem, shortened};

/// The edition of LM-63 that a file follows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Version {
    /// LM-63-1986: no first line of its own, free text before `TILT=`.
    Lm63In1986,
    /// `IESNA91`
    Lm63In1991,
    /// `IESNA:LM-63-1995`
    Lm63In1995,
    /// `IESNA:LM-63-2002`
    Lm63In2002,
    /// `IES:LM-63-2019`
    Lm63In2019,
}

/// One keyword with its text, its `[MORE]` lines joined to it by a space.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keyword {
    /// Without brackets, as in the file.
    pub name: String,
    /// Trimmed.
    pub text: String,
    /// The line of the keyword, counted from 1.
    pub line: usize,
}

/// What the file's intensities are in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IntensityUnit {
    /// Photometric; the standard's own unit, and meant when nothing is said.
    Candela,
    /// mW/sr
    MilliwattPerSteradian,
    /// µW/sr
    MicrowattPerSteradian,
    /// W/sr
    WattPerSteradian,
}

impl IntensityUnit {
    /// W/sr in one unit; none for a photometric unit, which no number turns into watts.
    pub const fn watts_per_steradian(self) -> Option<f64> {
        match self {
            Self::Candela => None,
            Self::MilliwattPerSteradian => Some(1e-3),
            Self::MicrowattPerSteradian => Some(1e-6),
            Self::WattPerSteradian => Some(1.0),
        }
    }

    /// The unit of the flux that such intensities integrate to.
    pub const fn flux_unit(self) -> &'static str {
        match self {
            Self::Candela => "lm",
            Self::MilliwattPerSteradian => "mW",
            Self::MicrowattPerSteradian => "µW",
            Self::WattPerSteradian => "W",
        }
    }

    /// The unit that a text begins with, if it begins with one. Case matters: mW is not MW.
    fn leading(text: &str) -> Option<Self> {
        const SPELLINGS: [(&str, IntensityUnit); 7] = [
            ("mW/sr", IntensityUnit::MilliwattPerSteradian),
            ("uW/sr", IntensityUnit::MicrowattPerSteradian),
            ("µW/sr", IntensityUnit::MicrowattPerSteradian),
            ("μW/sr", IntensityUnit::MicrowattPerSteradian),
            ("W/sr", IntensityUnit::WattPerSteradian),
            ("candela", IntensityUnit::Candela),
            ("cd", IntensityUnit::Candela),
        ];
        SPELLINGS.iter().find(|(spelling, _)| text.starts_with(spelling)).map(|(_, unit)| *unit)
    }
}

impl fmt::Display for IntensityUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Candela => "cd",
            Self::MilliwattPerSteradian => "mW/sr",
            Self::MicrowattPerSteradian => "µW/sr",
            Self::WattPerSteradian => "W/sr",
        })
    }
}

/// The edition named by the first line; 1986 if that line is none of the standard's.
pub(super) fn version(first_line: &str) -> Result<Version, Problem> {
    match first_line.trim() {
        "IESNA91" => Ok(Version::Lm63In1991),
        "IESNA:LM-63-1995" => Ok(Version::Lm63In1995),
        "IESNA:LM-63-2002" => Ok(Version::Lm63In2002),
        "IES:LM-63-2019" => Ok(Version::Lm63In2019),
        other if names_an_edition(other) => {
            Err(Problem::UnknownVersion { found: shortened(other) })
        }
        _ => Ok(Version::Lm63In1986),
    }
}

fn names_an_edition(line: &str) -> bool {
    line.get(..3).is_some_and(|start| start.eq_ignore_ascii_case("IES"))
}

/// Takes up one line of the label. Editions from 1991 on have nothing but keywords there.
pub(super) fn take_line(
    keywords: &mut Vec<Keyword>,
    version: Version,
    line: usize,
    text: &str,
) -> Result<(), Problem> {
    let trimmed = text.trim();
    if trimmed.is_empty() {
        return Ok(());
    }
    let Some((name, value)) = trimmed.strip_prefix('[').and_then(|rest| rest.split_once(']'))
    else {
        return match version {
            Version::Lm63In1986 if names_an_edition(trimmed) => {
                Err(Problem::MisplacedVersion { found: shortened(trimmed) })
            }
            Version::Lm63In1986 => Ok(()),
            _ => Err(Problem::NotAKeyword { found: shortened(trimmed) }),
        };
    };
    let (name, value) = (name.trim(), value.trim());
    if !name.eq_ignore_ascii_case("MORE") {
        keywords.push(Keyword { name: name.to_owned(), text: value.to_owned(), line });
        return Ok(());
    }
    let Some(continued) = keywords.last_mut() else {
        return Err(Problem::NotAKeyword { found: shortened(trimmed) });
    };
    continued.text.push(' ');
    continued.text.push_str(value);
    Ok(())
}

/// The unit that the keywords state, with the line that states it; none if they state none. Two
/// statements that differ are an error.
pub(super) fn intensity_unit(
    keywords: &[Keyword],
) -> Result<Option<IntensityUnit>, (usize, Problem)> {
    let mut stated: Option<IntensityUnit> = None;
    for keyword in keywords {
        let found = match stated_by(keyword) {
            Ok(Some(unit)) => unit,
            Ok(None) => continue,
            Err(problem) => return Err((keyword.line, problem)),
        };
        match stated {
            Some(first) if first != found => {
                let problem = Problem::ConflictingUnits { first, second: found };
                return Err((keyword.line, problem));
            }
            _ => stated = Some(found),
        }
    }
    Ok(stated)
}

/// `[_INTENSITYUNITS] mW/sr`, or in the text of `[TEST]` and `[OTHER]` `candela-> mW/sr` or
/// `intensity values ... are expressed in mW/sr`: what radiometric files are seen to write.
fn stated_by(keyword: &Keyword) -> Result<Option<IntensityUnit>, Problem> {
    let squeezed: String = keyword.text.split_whitespace().collect();
    if keyword.name.eq_ignore_ascii_case("_INTENSITYUNITS") {
        let unit = IntensityUnit::leading(&squeezed);
        return unit.map(Some).ok_or_else(|| Problem::UnknownUnit { found: shortened(&squeezed) });
    }
    if !["TEST", "OTHER"].iter().any(|name| keyword.name.eq_ignore_ascii_case(name)) {
        return Ok(None);
    }
    if let Some((_, after)) = squeezed.split_once("candela->") {
        let unit = IntensityUnit::leading(after);
        return unit.map(Some).ok_or_else(|| Problem::UnknownUnit { found: shortened(after) });
    }
    if let Some((_, after)) = squeezed.split_once("ntensityvalues")
        && let Some((_, after)) = after.split_once("expressedin")
    {
        return Ok(IntensityUnit::leading(after));
    }
    Ok(None)
}
