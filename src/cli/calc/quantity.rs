//! What a quantity is: its name, inputs with units, the answer's unit, an example, and the
//! function that answers. The tables themselves stand beside it, one for each family.

use std::fmt;

use glam::DVec3;
use radiometry::{DomainError, Estimate, EstimateError, Tolerance};
use serde_json::{Value, json};

use super::inputs::Inputs;
use super::{
    angles, bases, enclosures, form_factors, interfaces, irradiance, least_squares, light, motion,
    photometric, rays, solid_angles, statistics,
};

/// The families, in the order in which they are listed.
const FAMILIES: &[&[Quantity]] = &[
    angles::QUANTITIES,
    solid_angles::QUANTITIES,
    form_factors::QUANTITIES,
    light::QUANTITIES,
    irradiance::QUANTITIES,
    enclosures::QUANTITIES,
    photometric::QUANTITIES,
    interfaces::QUANTITIES,
    rays::QUANTITIES,
    bases::QUANTITIES,
    statistics::QUANTITIES,
    least_squares::QUANTITIES,
    motion::QUANTITIES,
];

/// One row of the table.
pub(super) struct Quantity {
    pub(super) name: &'static str,
    pub(super) inputs: &'static [Input],
    /// Unit of the value; "1" for a pure number.
    pub(super) unit: &'static str,
    /// What follows the name on the command line; no value holds a space.
    pub(super) example: &'static str,
    /// What rounding leaves, at most.
    pub(super) rounding: Rounding,
    pub(super) compute: fn(Inputs<'_>) -> Result<Answer, Refusal>,
}

/// A bound on the rounding error of a closed form.
pub(super) enum Rounding {
    /// Relative to the value.
    Relative(f64),
    /// In the value's unit.
    Absolute(f64),
    /// The function itself says so.
    Stated,
}

/// One input: its name and what it has to be, with the unit.
pub(super) struct Input {
    pub(super) name: &'static str,
    shape: &'static str,
    pub(super) is_required: bool,
}

impl Input {
    /// An input that has to be there.
    pub(super) const fn new(name: &'static str, shape: &'static str) -> Self {
        Self { name, shape, is_required: true }
    }

    /// One that has another beside it, or a default.
    pub(super) const fn optional(name: &'static str, shape: &'static str) -> Self {
        Self { name, shape, is_required: false }
    }
}

/// A value, or none; with a bound on its error where there is a value.
pub(super) struct Answer {
    pub(super) value: Value,
    pub(super) error_bound: Option<f64>,
}

impl Answer {
    /// A value whose error the function that found it bounds.
    pub(super) fn within(value: f64, error_bound: f64) -> Self {
        Self { value: number(value), error_bound: Some(error_bound) }
    }

    /// Values, each of whose errors is bounded.
    pub(super) fn list_within(values: impl Iterator<Item = f64>, error_bound: f64) -> Self {
        let values: Vec<Value> = values.map(number).collect();
        Self { value: values.into(), error_bound: Some(error_bound) }
    }

    /// Every number in it, whatever the shape.
    fn numbers(&self) -> Vec<f64> {
        match &self.value {
            Value::Array(items) => items.iter().map(|v| v.as_f64().unwrap_or(f64::NAN)).collect(),
            Value::Null => Vec::new(),
            value => vec![value.as_f64().unwrap_or(f64::NAN)],
        }
    }
}

/// What cannot be written as JSON is kept as text, which is no number: it is refused further on.
fn number(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or_else(|| value.to_string().into(), Value::Number)
}

impl From<f64> for Answer {
    fn from(value: f64) -> Self {
        Self { value: number(value), error_bound: None }
    }
}

impl From<Option<f64>> for Answer {
    fn from(value: Option<f64>) -> Self {
        value.map_or(Self { value: Value::Null, error_bound: None }, Self::from)
    }
}

impl From<DVec3> for Answer {
    fn from(vector: DVec3) -> Self {
        let components = vector.to_array().map(number).to_vec();
        Self { value: components.into(), error_bound: None }
    }
}

/// Why there is no answer: one sentence.
#[derive(Debug)]
pub(super) struct Refusal(String);

impl Refusal {
    pub(super) fn new(why: impl Into<String>) -> Self {
        Self(why.into())
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl From<DomainError> for Refusal {
    fn from(error: DomainError) -> Self {
        Self(error.to_string())
    }
}

impl From<EstimateError> for Refusal {
    fn from(error: EstimateError) -> Self {
        Self(error.to_string())
    }
}

impl From<Estimate> for Answer {
    fn from(estimate: Estimate) -> Self {
        Self::within(estimate.value, estimate.error_bound)
    }
}

/// How well an integral is asked for; ten digits where nothing is said.
pub(super) fn tolerance(inputs: Inputs<'_>) -> Result<Tolerance, Refusal> {
    if inputs.has("relative_tolerance") {
        Ok(Tolerance::from_relative(inputs.number("relative_tolerance")?)?)
    } else {
        Ok(Tolerance::default())
    }
}

/// A finite number that is not below zero.
pub(super) fn not_negative(inputs: Inputs<'_>, name: &str) -> Result<f64, Refusal> {
    let value = inputs.number(name)?;
    if value >= 0.0 {
        return Ok(value);
    }
    Err(Refusal::new(format!("{name} is {value}, expected 0 or more")))
}

impl Quantity {
    /// The answer, checked: known inputs only, all required ones, and a finite value.
    pub(super) fn answer(&self, inputs: Inputs<'_>) -> Result<Answer, Refusal> {
        inputs.expect_only(self.inputs)?;
        let mut answer = (self.compute)(inputs)?;
        let numbers = answer.numbers();
        if numbers.iter().any(|value| !value.is_finite()) {
            return Err(Refusal::new("the answer is beyond the range of a double"));
        }
        let largest = numbers.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
        if !numbers.is_empty() && answer.error_bound.is_none() {
            answer.error_bound = match self.rounding {
                Rounding::Relative(relative) => Some(relative * largest),
                Rounding::Absolute(absolute) => Some(absolute),
                Rounding::Stated => None,
            };
        }
        Ok(answer)
    }

    /// The command that shows it.
    pub(super) fn command(&self) -> String {
        format!("gonio calc {} {}", self.name, self.example).trim_end().to_owned()
    }

    /// For a person: the name with its unit, the inputs, the example.
    pub(super) fn description(&self) -> String {
        let input = |input: &Input| {
            let (open, close) = if input.is_required { ("", "") } else { ("[", "]") };
            format!("  {open}{}{close}: {}\n", input.name, input.shape)
        };
        let inputs: String = self.inputs.iter().map(input).collect();
        format!("{} ({})\n{inputs}  {}\n", self.name, self.unit, self.command())
    }

    /// The same for a program.
    pub(super) fn as_json(&self) -> Value {
        let input = |input: &Input| json!({"name": input.name, "is": input.shape, "required": input.is_required});
        let inputs: Vec<Value> = self.inputs.iter().map(input).collect();
        json!({
            "quantity": self.name,
            "unit": self.unit,
            "inputs": inputs,
            "example": self.command(),
        })
    }
}

/// Every quantity.
pub(super) fn all() -> impl Iterator<Item = &'static Quantity> {
    FAMILIES.iter().flat_map(|family| family.iter())
}

/// The quantity of that name.
pub(super) fn named(name: &str) -> Result<&'static Quantity, Refusal> {
    all().find(|quantity| quantity.name == name).ok_or_else(|| {
        let known: Vec<String> = all().map(|quantity| quantity.name.to_owned()).collect();
        let meant = spanned_toml::nearest(name, &known)
            .map_or_else(String::new, |nearest| format!(", did you mean `{nearest}`?"));
        Refusal::new(format!(
            "quantity `{name}` is not known{meant}; `gonio calc --list` shows them all"
        ))
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_are_unique_and_every_input_of_an_example_is_declared() {
        let mut names = BTreeSet::new();
        for quantity in all() {
            assert!(names.insert(quantity.name), "{} stands twice", quantity.name);
            let declared: BTreeSet<_> = quantity.inputs.iter().map(|i| i.name).collect();
            assert_eq!(declared.len(), quantity.inputs.len(), "{}", quantity.name);
        }
    }

    #[test]
    fn a_slip_in_a_name_is_answered_with_the_name() {
        let refusal = named("disk-sold-angle").err().expect("no such quantity").to_string();
        assert!(refusal.contains("did you mean `disk-solid-angle`?"), "{refusal}");
        assert!(!named("x").err().expect("none").to_string().contains("did you mean"));
    }

    #[test]
    fn what_is_no_finite_number_is_refused() {
        for value in [f64::NAN, f64::INFINITY] {
            let quantity = Quantity {
                name: "test",
                inputs: &[],
                unit: "1",
                example: "",
                rounding: Rounding::Stated,
                compute: if value.is_nan() {
                    |_| Ok(f64::NAN.into())
                } else {
                    |_| Ok(Answer::within(f64::INFINITY, 0.0))
                },
            };
            assert!(quantity.answer(Inputs::new(&serde_json::Map::new())).is_err());
        }
    }
}
