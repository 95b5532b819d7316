//! Form factors: the part of the diffuse flux from surface 1 that reaches surface 2.

use radiometry::Tolerance;
use radiometry::form_factor;
use radiometry::quantity::FormFactor;
use radiometry::shape::Polygon;

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding, tolerance};
use super::solid_angles::occluder;

const R1: Input = Input::new("r1", "m");
const R2: Input = Input::new("r2", "m");
const H: Input = Input::new("h", "m");
const A: Input = Input::new("a", "m");
const B: Input = Input::new("b", "m");
const L: Input = Input::new("l", "m, the shared edge");

/// Of a closed form or an integral of a positive function.
const ROUNDING: Rounding = Rounding::Relative(1e-12);

/// A form factor with a closed form.
const fn closed(
    name: &'static str,
    inputs: &'static [Input],
    example: &'static str,
    compute: fn(Inputs<'_>) -> Result<Answer, Refusal>,
) -> Quantity {
    Quantity { name, inputs, unit: "1", example, rounding: ROUNDING, compute }
}

/// One that is integrated.
const fn integrated(
    name: &'static str,
    inputs: &'static [Input],
    example: &'static str,
    compute: fn(Inputs<'_>) -> Result<Answer, Refusal>,
) -> Quantity {
    Quantity { name, inputs, unit: "1", example, rounding: Rounding::Stated, compute }
}

pub(super) const QUANTITIES: &[Quantity] = &[
    closed("form-factor-coaxial-disks", &[R1, R2, H], "--r1 1 --r2 1 --h 1", |inputs| {
        let [r1, r2, h] = numbers(inputs, ["r1", "r2", "h"])?;
        Ok(form_factor::coaxial_disks(r1, r2, h)?.into())
    }),
    integrated(
        "form-factor-parallel-disks",
        &[R1, R2, H, Input::new("offset", "m")],
        "--r1 1 --r2 1 --h 1.5 --offset 0.5",
        |inputs| {
            let [r1, r2, h, offset] = numbers(inputs, ["r1", "r2", "h", "offset"])?;
            Ok(form_factor::parallel_disks(r1, r2, h, offset, Tolerance::default())?.into())
        },
    ),
    closed(
        "form-factor-parallel-rectangles",
        &[A, B, Input::new("c", "m, gap")],
        "--a 1 --b 1 --c 1",
        |inputs| {
            let [a, b, c] = numbers(inputs, ["a", "b", "c"])?;
            Ok(form_factor::parallel_rectangles(a, b, c)?.into())
        },
    ),
    closed(
        "form-factor-perpendicular-rectangles",
        &[Input::new("w", "m, the floor's"), Input::new("h", "m, the wall's"), L],
        "--w 1 --h 1 --l 1",
        |inputs| {
            let [w, h, l] = numbers(inputs, ["w", "h", "l"])?;
            Ok(form_factor::perpendicular_rectangles(w, h, l)?.into())
        },
    ),
    closed(
        "form-factor-aligned-rectangles",
        &[
            Input::new("x1", "m, of 1 at height 0"),
            Input::new("x2", "m"),
            Input::new("y1", "m"),
            Input::new("y2", "m"),
            Input::new("xi1", "m, x of 2"),
            Input::new("xi2", "m"),
            Input::new("eta1", "m, y of 2"),
            Input::new("eta2", "m"),
            Input::new("z", "m, height of 2"),
        ],
        "--x1 0 --x2 1 --y1 0 --y2 1 --xi1 0 --xi2 1 --eta1 0 --eta2 1 --z 1",
        |inputs| {
            let (x, y) = (numbers(inputs, ["x1", "x2"])?, numbers(inputs, ["y1", "y2"])?);
            let (xi, eta) = (numbers(inputs, ["xi1", "xi2"])?, numbers(inputs, ["eta1", "eta2"])?);
            Ok(form_factor::aligned_rectangles(x, y, xi, eta, inputs.number("z")?)?.into())
        },
    ),
    closed(
        "form-factor-perpendicular-offset-rectangles",
        &[
            Input::new("x1", "m, of 1 in z = 0"),
            Input::new("x2", "m"),
            Input::new("y1", "m"),
            Input::new("y2", "m"),
            Input::new("z1", "m, of 2 in x = 0"),
            Input::new("z2", "m"),
            Input::new("eta1", "m, y of 2"),
            Input::new("eta2", "m"),
        ],
        "--x1 0 --x2 1 --y1 0 --y2 1 --z1 0 --z2 1 --eta1 0 --eta2 1",
        |inputs| {
            let (x, y) = (numbers(inputs, ["x1", "x2"])?, numbers(inputs, ["y1", "y2"])?);
            let (z, eta) = (numbers(inputs, ["z1", "z2"])?, numbers(inputs, ["eta1", "eta2"])?);
            Ok(form_factor::perpendicular_offset_rectangles(x, y, z, eta)?.into())
        },
    ),
    integrated(
        "form-factor-wedge-rectangles",
        &[A, B, L, Input::new("cos_phi", "cosine of the angle between them")],
        "--a 1 --b 5 --l 2 --cos-phi 0.6",
        |inputs| {
            let [a, b, l, cos_phi] = numbers(inputs, ["a", "b", "l", "cos_phi"])?;
            Ok(form_factor::wedge_rectangles(a, b, l, cos_phi, Tolerance::FINE)?.into())
        },
    ),
    closed(
        "form-factor-sphere-disk",
        &[R1, Input::new("h", "m, from the sphere's centre to the disk"), R2],
        "--r1 1 --h 2 --r2 1",
        |inputs| {
            let [r1, h, r2] = numbers(inputs, ["r1", "h", "r2"])?;
            Ok(form_factor::sphere_disk(r1, h, r2)?.into())
        },
    ),
    integrated(
        "form-factor-spheres",
        &[R1, R2, Input::new("d", "m, between centres")],
        "--r1 1 --r2 1 --d 4",
        |inputs| {
            let [r1, r2, d] = numbers(inputs, ["r1", "r2", "d"])?;
            Ok(form_factor::spheres(r1, r2, d, Tolerance::default())?.into())
        },
    ),
    closed(
        "form-factor-concentric-spheres",
        &[Input::new("r1", "m, inner"), Input::new("r2", "m, outer, where the flux leaves")],
        "--r1 1 --r2 2",
        |inputs| {
            let [r1, r2] = numbers(inputs, ["r1", "r2"])?;
            Ok(form_factor::concentric_spheres(r1, r2)?.into())
        },
    ),
    closed(
        "form-factor-strips",
        &[
            Input::new("p0", "x,y, m"),
            Input::new("p1", "x,y, m"),
            Input::new("q0", "x,y, m"),
            Input::new("q1", "x,y, m"),
        ],
        "--p0 0,0 --p1 1,0 --q0 0,1 --q1 1,1",
        |inputs| {
            let from = [inputs.point_2d("p0")?, inputs.point_2d("p1")?];
            let to = [inputs.point_2d("q0")?, inputs.point_2d("q1")?];
            Ok(form_factor::strips(from, to)?.into())
        },
    ),
    closed(
        "form-factor-parallel-cylinders",
        &[Input::new("r", "m"), Input::new("d", "m, between axes")],
        "--r 1 --d 3",
        |inputs| {
            let [r, d] = numbers(inputs, ["r", "d"])?;
            Ok(form_factor::parallel_cylinders(r, d)?.into())
        },
    ),
    integrated(
        "form-factor-polygons",
        &[
            Input::new("from", "list of [x,y,z], m"),
            Input::new("to", "list of [x,y,z], m"),
            Input::optional("occluders", "list of bodies as for occluded-projected-solid-angle"),
            Input::optional(
                "relative_tolerance",
                "default 1e-10; with occluders 1e-6, of the factor without them",
            ),
        ],
        "--from [[0,0,0],[1,0,0],[1,1,0],[0,1,0]] --to [[0,0,1],[0,1,1],[1,1,1],[1,0,1]] \
         --occluders [{\"kind\":\"sphere\",\"center\":[0.5,0.5,0.5],\"radius\":0.2}] \
         --relative-tolerance 1e-4",
        |inputs| {
            let polygon = |name| Ok::<_, Refusal>(Polygon::new(inputs.vectors(name)?)?);
            let (from, to) = (polygon("from")?, polygon("to")?);
            if !inputs.has("occluders") {
                return Ok(form_factor::polygons(&from, &to, tolerance(inputs)?)?.into());
            }
            let bodies = inputs.objects("occluders")?.into_iter().map(occluder);
            let bodies = bodies.collect::<Result<Vec<_>, _>>()?;
            let tolerance = if inputs.has("relative_tolerance") {
                tolerance(inputs)?
            } else {
                Tolerance::from_relative(1e-6)?
            };
            Ok(form_factor::polygons_occluded(&from, &to, &bodies, tolerance)?.into())
        },
    ),
];

impl From<FormFactor> for Answer {
    fn from(factor: FormFactor) -> Self {
        factor.ratio().into()
    }
}

fn numbers<const N: usize>(inputs: Inputs<'_>, names: [&str; N]) -> Result<[f64; N], Refusal> {
    let mut numbers = [0.0; N];
    for (number, name) in numbers.iter_mut().zip(names) {
        *number = inputs.number(name)?;
    }
    Ok(numbers)
}
