//! Unweighted least squares, answered by the fit crate.

use fit::regression::{Linear, Polynomial, RegressionError, Yield};

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding};

const X: Input = Input::new("x", "list of numbers");
const Y: Input = Input::new("y", "list of numbers");
const DEGREE: Input = Input::new("degree", "whole number");
const COLUMNS: Input = Input::new("columns", "list of lists of numbers");

/// Refused by the fit long before.
const DEGREE_MAX: usize = 1000;

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "polyfit-coefficient",
        inputs: &[X, Y, DEGREE, Input::new("index", "power of x, 0 to degree")],
        unit: "1",
        example: "--x 0,1,2,3 --y 1,3,5,8 --degree 1 --index 1",
        rounding: Rounding::Stated,
        compute: |inputs| {
            let index = inputs.count("index", DEGREE_MAX)?;
            Ok(value(polynomial(inputs)?.coefficient(index)?))
        },
    },
    Quantity {
        name: "polyfit-coefficient-sd",
        inputs: &[X, Y, DEGREE, Input::new("index", "power of x, 0 to degree")],
        unit: "1",
        example: "--x 0,1,2,3 --y 1,3,5,8 --degree 1 --index 1",
        rounding: Rounding::Relative(1e-9),
        compute: |inputs| {
            let index = inputs.count("index", DEGREE_MAX)?;
            sd(polynomial(inputs)?.coefficient(index)?)
        },
    },
    Quantity {
        name: "polyfit-residual-sd",
        inputs: &[X, Y, DEGREE],
        unit: "1",
        example: "--x 0,1,2,3 --y 1,3,5,8 --degree 1",
        rounding: Rounding::Relative(1e-9),
        compute: |inputs| Ok(polynomial(inputs)?.residual_sd()?.into()),
    },
    Quantity {
        name: "polyfit-value",
        inputs: &[X, Y, DEGREE, Input::new("at", "number")],
        unit: "1",
        example: "--x 0,1,2,3 --y 1,3,5,8 --degree 1 --at 1.5",
        rounding: Rounding::Stated,
        compute: |inputs| Ok(value(polynomial(inputs)?.value(inputs.number("at")?)?)),
    },
    Quantity {
        name: "linear-fit-coefficient",
        inputs: &[COLUMNS, Y, Input::new("index", "0 = intercept, then by column")],
        unit: "1",
        example: "--columns [[0,1,2,3],[1,0,0,1]] --y 5,4,6,11.5 --index 0",
        rounding: Rounding::Stated,
        compute: |inputs| {
            let index = inputs.count("index", DEGREE_MAX)?;
            Ok(value(linear(inputs)?.coefficient(index)?))
        },
    },
    Quantity {
        name: "linear-fit-coefficient-sd",
        inputs: &[COLUMNS, Y, Input::new("index", "0 = intercept, then by column")],
        unit: "1",
        example: "--columns [[0,1,2,3],[1,0,0,1]] --y 5,4,6,11.5 --index 0",
        rounding: Rounding::Relative(1e-9),
        compute: |inputs| {
            let index = inputs.count("index", DEGREE_MAX)?;
            sd(linear(inputs)?.coefficient(index)?)
        },
    },
];

impl From<RegressionError> for Refusal {
    fn from(error: RegressionError) -> Self {
        Self::new(error.to_string())
    }
}

fn polynomial(inputs: Inputs<'_>) -> Result<Polynomial, Refusal> {
    let degree = inputs.count("degree", DEGREE_MAX)?;
    Ok(Polynomial::fit(&inputs.numbers("x")?, &inputs.numbers("y")?, degree)?)
}

fn linear(inputs: Inputs<'_>) -> Result<Linear, Refusal> {
    let columns = inputs.columns("columns")?;
    if columns.is_empty() {
        return Err(Refusal::new("columns is empty, expected at least one"));
    }
    Ok(Linear::fit(&columns, &inputs.numbers("y")?)?)
}

fn value(found: Yield) -> Answer {
    Answer::within(found.value, found.rounding)
}

fn sd(found: Yield) -> Result<Answer, Refusal> {
    Ok(found.sd.ok_or(RegressionError::NoScatter)?.into())
}
