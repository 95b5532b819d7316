//! The inputs of one request, read strictly: a number is a finite number, a vector three of them,
//! and no key is passed over. What the numbers mean is not known here.

use glam::{DVec2, DVec3};
use serde_json::{Map, Value};

use super::quantity::{Input, Refusal};

/// The named values of a request.
#[derive(Clone, Copy)]
pub(super) struct Inputs<'a>(&'a Map<String, Value>);

/// A value under its name, so that a refusal can say which.
type Named<'a> = (&'a str, &'a Value);

impl<'a> Inputs<'a> {
    pub(super) const fn new(values: &'a Map<String, Value>) -> Self {
        Self(values)
    }

    /// Every required input is there, and none that nobody reads.
    pub(super) fn expect_only(self, known: &[Input]) -> Result<(), Refusal> {
        if let Some(missing) = known.iter().find(|i| i.is_required && !self.has(i.name)) {
            return Err(Refusal::new(format!("the input `{}` is missing", missing.name)));
        }
        let stranger = self.0.keys().find(|key| known.iter().all(|input| input.name != **key));
        match stranger {
            None => Ok(()),
            Some(key) => {
                let names: Vec<_> = known.iter().map(|input| input.name).collect();
                let expected = names.join(", ");
                Err(Refusal::new(format!("the input `{key}` is not known, expected {expected}")))
            }
        }
    }

    pub(super) fn has(self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    fn value<'n>(self, name: &'n str) -> Result<(&'n str, &'a Value), Refusal> {
        let value = self.0.get(name);
        let missing = || Refusal::new(format!("the input `{name}` is missing"));
        value.map(|value| (name, value)).ok_or_else(missing)
    }

    /// A finite number.
    pub(super) fn number(self, name: &str) -> Result<f64, Refusal> {
        let (name, value) = self.value(name)?;
        as_number((name, value))
    }

    /// A whole number from 0 up, at most `max`.
    pub(super) fn count(self, name: &str, max: usize) -> Result<usize, Refusal> {
        let number = self.integer(name, 0, i64::try_from(max).unwrap_or(i64::MAX))?;
        usize::try_from(number).map_err(|_| Refusal::new(format!("{name} is {number}")))
    }

    /// A whole number between two others, inclusive.
    pub(super) fn integer(self, name: &str, min: i64, max: i64) -> Result<i64, Refusal> {
        let number = self.number(name)?;
        let is_whole = libm::trunc(number).to_bits() == number.to_bits() || number == 0.0;
        if !is_whole || !(min as f64..=max as f64).contains(&number) {
            let expected = format!("expected a whole number from {min} to {max}");
            return Err(Refusal::new(format!("{name} is {number}, {expected}")));
        }
        #[expect(clippy::cast_possible_truncation, reason = "whole, and between two i64")]
        Ok(number as i64)
    }

    /// Three finite numbers.
    pub(super) fn vector(self, name: &str) -> Result<DVec3, Refusal> {
        let (name, value) = self.value(name)?;
        as_vector((name, value))
    }

    /// Three finite numbers, not all zero.
    pub(super) fn direction(self, name: &str) -> Result<DVec3, Refusal> {
        let vector = self.vector(name)?;
        if vector == DVec3::ZERO {
            return Err(Refusal::new(format!("{name} is the zero vector, expected a direction")));
        }
        Ok(vector)
    }

    /// Two finite numbers.
    pub(super) fn point_2d(self, name: &str) -> Result<DVec2, Refusal> {
        let (name, value) = self.value(name)?;
        let [x, y] = as_array((name, value))?;
        Ok(DVec2::new(x, y))
    }

    /// A list of vectors.
    pub(super) fn vectors(self, name: &str) -> Result<Vec<DVec3>, Refusal> {
        self.list(name)?.iter().map(|value| as_vector((name, value))).collect()
    }

    /// A list of triangles, each of three vectors.
    pub(super) fn triangles(self, name: &str) -> Result<Vec<[DVec3; 3]>, Refusal> {
        let triangle = |value: &Value| {
            let corners = as_list((name, value))?;
            let corners: Vec<_> =
                corners.iter().map(|value| as_vector((name, value))).collect::<Result<_, _>>()?;
            <[DVec3; 3]>::try_from(corners)
                .map_err(|found| wrong((name, value), &format!("3 corners, found {}", found.len())))
        };
        self.list(name)?.iter().map(triangle).collect()
    }

    /// A list of finite numbers.
    pub(super) fn numbers(self, name: &str) -> Result<Vec<f64>, Refusal> {
        self.list(name)?.iter().map(|value| as_number((name, value))).collect()
    }

    /// A list of lists of finite numbers.
    pub(super) fn columns(self, name: &str) -> Result<Vec<Vec<f64>>, Refusal> {
        let column = |value: &Value| {
            as_list((name, value))?.iter().map(|value| as_number((name, value))).collect()
        };
        self.list(name)?.iter().map(column).collect()
    }

    /// A list of polygons, each a list of vectors.
    pub(super) fn polygons(self, name: &str) -> Result<Vec<Vec<DVec3>>, Refusal> {
        let polygon = |value: &Value| {
            as_list((name, value))?.iter().map(|value| as_vector((name, value))).collect()
        };
        self.list(name)?.iter().map(polygon).collect()
    }

    /// Named values within a value.
    pub(super) fn object(self, name: &str) -> Result<Inputs<'a>, Refusal> {
        let (name, value) = self.value(name)?;
        value.as_object().map(Inputs).ok_or_else(|| wrong((name, value), "an object"))
    }

    /// A list of named values.
    pub(super) fn objects(self, name: &str) -> Result<Vec<Inputs<'a>>, Refusal> {
        let object = |value: &'a Value| {
            value.as_object().map(Inputs).ok_or_else(|| wrong((name, value), "an object"))
        };
        self.list(name)?.iter().map(object).collect()
    }

    /// A word.
    pub(super) fn text(self, name: &str) -> Result<&'a str, Refusal> {
        let (name, value) = self.value(name)?;
        value.as_str().ok_or_else(|| wrong((name, value), "a word"))
    }

    fn list(self, name: &str) -> Result<&'a [Value], Refusal> {
        let (name, value) = self.value(name)?;
        value.as_array().map(Vec::as_slice).ok_or_else(|| wrong((name, value), "a list"))
    }
}

fn as_number(named: Named<'_>) -> Result<f64, Refusal> {
    let number = named.1.as_f64().filter(|value| named.1.is_number() && value.is_finite());
    number.ok_or_else(|| wrong(named, "a finite number"))
}

fn as_list(named: Named<'_>) -> Result<&[Value], Refusal> {
    named.1.as_array().map(Vec::as_slice).ok_or_else(|| wrong(named, "a list"))
}

fn as_array<const N: usize>((name, value): Named<'_>) -> Result<[f64; N], Refusal> {
    let list = as_list((name, value))?;
    let numbers: Vec<f64> =
        list.iter().map(|value| as_number((name, value))).collect::<Result<_, _>>()?;
    numbers.try_into().map_err(|_| wrong((name, value), &format!("{N} numbers")))
}

fn as_vector(named: Named<'_>) -> Result<DVec3, Refusal> {
    Ok(DVec3::from_array(as_array::<3>(named)?))
}

/// What was found and what was expected, however long what was found is.
fn wrong((name, value): Named<'_>, expected: &str) -> Refusal {
    /// Enough to recognise it by.
    const SHOWN: usize = 40;
    let found = value.to_string();
    let shown: String = found.chars().take(SHOWN).collect();
    let rest = if shown.len() < found.len() { "..." } else { "" };
    Refusal::new(format!("{name} is {shown}{rest}, expected {expected}"))
}
