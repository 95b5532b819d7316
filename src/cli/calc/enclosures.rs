//! The balance of radiosity in an enclosure of diffuse surfaces.

use radiometry::enclosure::{Enclosure, EnclosureError, Radiosity};
use radiometry::quantity::{Area, Exitance, FormFactor};
use radiometry::shape::Polygon;

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding, tolerance};

/// What the given factors of a row may miss of 1, or a pair of reciprocity, as written with six digits.
const MISSING_MAX: f64 = 1e-6;

const INPUTS: &[Input] = &[
    Input::optional("areas", "list of m², with form_factors"),
    Input::optional(
        "form_factors",
        "list of rows, F of row i and column j from surface i to j; each row sums to 1",
    ),
    Input::optional(
        "surfaces",
        "instead of both: list of polygons, each a list of [x,y,z], m, in counter-clockwise order \
         as seen from inside; they enclose a room, an opening is one that reflects nothing",
    ),
    Input::new("emitted", "list of W/m², what each surface emits by itself"),
    Input::new("reflectance", "list of numbers 0 to 1, diffuse, one for each surface"),
    Input::optional("relative_tolerance", "of the form factors of surfaces, default 1e-10"),
];

/// Two plates of a wide pair.
const PLATES: &str = "--areas [1,1] --form-factors [[0,1],[1,0]] --emitted [100,0] \
                      --reflectance [0.5,0.8]";
const TETRAHEDRON: &str = "--surfaces [[[0,0,0],[1,0,0],[0,1,0]],[[0,0,0],[0,0,1],[1,0,0]],\
                           [[0,0,0],[0,1,0],[0,0,1]],[[1,0,0],[0,0,1],[0,1,0]]] \
                           --emitted [100,0,0,0] --reflectance [0.2,0.5,0.5,0.8] \
                           --relative-tolerance 1e-8";

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "radiosity-exitances",
        inputs: INPUTS,
        unit: "W/m²",
        example: PLATES,
        rounding: Rounding::Stated,
        compute: |inputs| {
            let (balance, bound) = balance(inputs)?;
            Ok(Answer::list_within(balance.exitance.iter().map(|m| m.w_per_m2()), bound))
        },
    },
    Quantity {
        name: "radiosity-irradiances",
        inputs: INPUTS,
        unit: "W/m²",
        example: TETRAHEDRON,
        rounding: Rounding::Stated,
        compute: |inputs| {
            let (balance, bound) = balance(inputs)?;
            Ok(Answer::list_within(balance.irradiance.iter().map(|e| e.w_per_m2()), bound))
        },
    },
];

impl From<EnclosureError> for Refusal {
    fn from(error: EnclosureError) -> Self {
        Self::new(error.to_string())
    }
}

fn balance(inputs: Inputs<'_>) -> Result<(Radiosity, f64), Refusal> {
    let (enclosure, row_error) =
        if inputs.has("surfaces") { from_surfaces(inputs)? } else { from_matrix(inputs)? };
    let emitted: Vec<Exitance> =
        inputs.numbers("emitted")?.into_iter().map(Exitance::from_w_per_m2).collect();
    let reflectance = inputs.numbers("reflectance")?;
    let balance = enclosure.radiosity(&emitted, &reflectance)?;
    let bound = enclosure.radiosity_error_bound(&emitted, &reflectance, &balance, row_error)?;
    Ok((balance, bound))
}

/// With what all the factors from one surface can be off together.
fn from_surfaces(inputs: Inputs<'_>) -> Result<(Enclosure, f64), Refusal> {
    if inputs.has("areas") || inputs.has("form_factors") {
        return Err(Refusal::new(
            "surfaces are given beside areas or form_factors, expected either",
        ));
    }
    let polygon = |vertices| Ok::<_, Refusal>(Polygon::new(vertices)?);
    let faces = inputs.polygons("surfaces")?;
    let faces: Vec<Polygon> = faces.into_iter().map(polygon).collect::<Result<_, _>>()?;
    let tolerance = tolerance(inputs)?;
    let enclosure = Enclosure::from_polygons(&faces, tolerance)?;
    // Each pair's own, and what the rest to 1 takes over from them.
    let row_error = 2.0 * tolerance.relative() * faces.len() as f64;
    for surface in 0..faces.len() {
        let own = enclosure.form_factor(surface, surface).map_or(0.0, FormFactor::ratio);
        if own > MISSING_MAX.max(row_error) {
            return Err(Refusal::new(format!(
                "the form factors from surface {surface} to the others sum to {}, expected 1: the \
                 surfaces do not close, or are not counter-clockwise as seen from inside",
                1.0 - own
            )));
        }
    }
    Ok((enclosure, row_error))
}

/// With how far from what was given the factors are that obey the laws.
fn from_matrix(inputs: Inputs<'_>) -> Result<(Enclosure, f64), Refusal> {
    let areas = inputs.numbers("areas")?;
    let factors = inputs.columns("form_factors")?;
    let count = areas.len();
    if factors.len() != count || factors.iter().any(|row| row.len() != count) {
        return Err(Refusal::new(format!(
            "form_factors is no matrix of {count} by {count}, expected one row and column for each \
             area"
        )));
    }
    for (i, row) in factors.iter().enumerate() {
        let sum: f64 = row.iter().sum();
        if (sum - 1.0).abs() > MISSING_MAX {
            return Err(Refusal::new(format!(
                "the form factors from surface {i} sum to {sum}, expected 1: an opening is a \
                 surface too"
            )));
        }
        for (j, factor) in row.iter().enumerate() {
            let (there, back) = (areas[i] * factor, areas[j] * factors[j][i]);
            if (there - back).abs() > MISSING_MAX * areas[i].abs().max(areas[j].abs()) {
                return Err(Refusal::new(format!(
                    "area times form factor is {there} from surface {i} to {j} and {back} back, \
                     expected the same"
                )));
            }
        }
    }
    let areas: Vec<Area> = areas.into_iter().map(Area::from_m2).collect();
    let enclosure = Enclosure::new(&areas, |i, j| FormFactor::from_ratio(factors[i][j]))?;
    let changed = |i: usize, j: usize, given: f64| {
        (enclosure.form_factor(i, j).map_or(0.0, FormFactor::ratio) - given).abs()
    };
    let of_row = |(i, row): (usize, &Vec<f64>)| -> f64 {
        row.iter().enumerate().map(|(j, given)| changed(i, j, *given)).sum()
    };
    let row_error = factors.iter().enumerate().map(of_row).fold(0.0, f64::max);
    Ok((enclosure, row_error))
}
