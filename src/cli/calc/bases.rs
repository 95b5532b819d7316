//! Single members of the bases.

use radiometry::basis::{harmonics, legendre, zernike};

use super::quantity::{Input, Quantity, Rounding};

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
];
