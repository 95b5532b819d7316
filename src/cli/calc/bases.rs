//! Single members of the bases.

use radiometry::basis::{
    Active, BSpline, DEGREE_MAX as SPLINE_DEGREE_MAX, harmonics, legendre, zernike,
};

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding};

/// Stable far beyond what is fitted; the recurrences take a step for each degree.
const DEGREE_MAX: usize = 10_000;

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "zernike-radial",
        inputs: &[
            Input::new("n", "degree"),
            Input::new("m", "azimuthal order, of n's parity, 0 to n"),
            Input::new("r", "0 to 1"),
        ],
        unit: "1",
        example: "--n 4 --m 2 --r 0.5",
        rounding: Rounding::Absolute(1e-13),
        compute: |inputs| {
            let (n, m) = (inputs.count("n", DEGREE_MAX)?, inputs.count("m", DEGREE_MAX)?);
            Ok(zernike::radial(n, m, inputs.number("r")?)?.into())
        },
    },
    Quantity {
        name: "legendre",
        inputs: &[Input::new("l", "degree"), Input::new("x", "-1 to 1")],
        unit: "1",
        example: "--l 2 --x 0.5",
        rounding: Rounding::Absolute(1e-13),
        compute: |inputs| {
            let degree = inputs.count("l", DEGREE_MAX)?;
            Ok(legendre::polynomial(degree, inputs.number("x")?)?.into())
        },
    },
    Quantity {
        name: "spherical-harmonic",
        inputs: &[
            Input::new("l", "degree"),
            Input::new("m", "order, 0 to l"),
            Input::new("theta", "rad, 0 to π"),
        ],
        unit: "1/√sr",
        example: "--l 2 --m 1 --theta 1",
        rounding: Rounding::Relative(1e-12),
        compute: |inputs| {
            let (l, m) = (inputs.count("l", DEGREE_MAX)?, inputs.count("m", DEGREE_MAX)?);
            Ok(harmonics::amplitude(l, m, inputs.number("theta")?)?.into())
        },
    },
    Quantity {
        name: "b-spline",
        inputs: &SPLINE,
        unit: "1",
        example: "--degree 3 --breaks 0,1,2,3 --index 2 --x 1.5",
        rounding: Rounding::Absolute(1e-14),
        compute: |inputs| {
            let spline = spline(inputs)?;
            Ok(of_index(inputs, &spline, spline.nonzero(inputs.number("x")?)?)?.into())
        },
    },
    Quantity {
        name: "b-spline-slope",
        inputs: &SPLINE,
        unit: "1/(unit of x)",
        example: "--degree 3 --breaks 0,1,2,3 --index 2 --x 1.5",
        rounding: Rounding::Stated,
        compute: |inputs| {
            let spline = spline(inputs)?;
            let active = spline.nonzero_derivatives(inputs.number("x")?, 1)?;
            // Differences of neighbours: the roundings are those of the largest.
            let largest = active.values().iter().fold(0.0, |most: f64, v| most.max(v.abs()));
            Ok(Answer::within(of_index(inputs, &spline, active)?, 1e-14 * largest))
        },
    },
];

const SPLINE: [Input; 5] = [
    Input::new("degree", "0 to 15"),
    Input::new("breaks", "list, rising, both ends once; in the unit of x"),
    Input::new("index", "which function, from 0"),
    Input::new("x", "within the breaks, or any if periodic"),
    Input::optional("periodic", "1: the last break is the first, a turn on; default 0"),
];

fn spline(inputs: Inputs<'_>) -> Result<BSpline, Refusal> {
    let (degree, breaks) = (inputs.count("degree", SPLINE_DEGREE_MAX)?, inputs.numbers("breaks")?);
    let is_periodic = inputs.has("periodic") && inputs.count("periodic", 1)? == 1;
    let new = if is_periodic { BSpline::periodic } else { BSpline::open };
    Ok(new(degree, &breaks)?)
}

/// 0 where the function is not among those around x.
fn of_index(inputs: Inputs<'_>, spline: &BSpline, active: Active) -> Result<f64, Refusal> {
    let index = inputs.count("index", spline.len() - 1)?;
    Ok(active.iter().find(|(at, _)| *at == index).map_or(0.0, |(_, value)| value))
}
