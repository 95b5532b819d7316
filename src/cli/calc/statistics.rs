//! Sums and moments of readings.

use radiometry::moments::{self, Moments};

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding};

/// A generator never makes more.
const VALUES_MAX: usize = 10_000_000;

const VALUES: Input = Input::optional("values", "list of numbers");
const GENERATOR: Input =
    Input::optional("generator", "{kind: stride | repeat | alternating | harmonic, ...}");

const WEIGHTS: Input = Input::optional("weights", "list of numbers, default all 1");

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "sum",
        inputs: &[VALUES, GENERATOR],
        unit: "1",
        example: "--values [1e16,1,-1e16]",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| Ok(moments::sum(&readings(inputs)?.0)?.into()),
    },
    Quantity {
        name: "weighted-mean",
        inputs: &[VALUES, WEIGHTS, GENERATOR],
        unit: "1",
        example: "--values 1,2,4 --weights 1,1,2",
        rounding: Rounding::Relative(1e-14),
        compute: |inputs| {
            let (values, weights) = readings(inputs)?;
            Ok(moments::weighted_mean(&values, &weights)?.into())
        },
    },
    Quantity {
        name: "weighted-variance",
        inputs: &[VALUES, WEIGHTS, GENERATOR],
        unit: "1",
        example: "--values 1,2,4 --weights 1,1,2",
        rounding: Rounding::Relative(1e-13),
        compute: |inputs| {
            let (values, weights) = readings(inputs)?;
            Ok(moments::weighted_variance(&values, &weights)?.into())
        },
    },
    Quantity {
        name: "weighted-std",
        inputs: &[VALUES, WEIGHTS, GENERATOR],
        unit: "1",
        example: "--values 1,2,4 --weights 1,1,2",
        rounding: Rounding::Relative(1e-13),
        compute: |inputs| {
            let (values, weights) = readings(inputs)?;
            Ok(moments::weighted_std(&values, &weights)?.into())
        },
    },
    Quantity {
        name: "sample-variance",
        inputs: &[VALUES, GENERATOR],
        unit: "1",
        example: "--values 1000000004,1000000007,1000000013,1000000016",
        rounding: Rounding::Relative(1e-13),
        compute: |inputs| Ok(moments::sample_variance(&readings(inputs)?.0)?.into()),
    },
    Quantity {
        name: "merged-variance",
        inputs: &[Input::new("parts", "list of {n, mean, m2}, m2 = Σ (value - mean)²")],
        unit: "1",
        example: "--parts [{\"n\":3,\"mean\":1,\"m2\":0.5},{\"n\":2,\"mean\":1.5,\"m2\":0.1}]",
        rounding: Rounding::Relative(1e-13),
        compute: merged_variance,
    },
];

/// Of the population that all parts make together.
fn merged_variance(inputs: Inputs<'_>) -> Result<Answer, Refusal> {
    let keys = ["n", "mean", "m2"].map(|key| Input::new(key, "number"));
    let mut merged = Moments::default();
    let parts = inputs.objects("parts")?;
    if parts.is_empty() {
        return Err(Refusal::new("parts is empty, expected at least one"));
    }
    for part in parts {
        part.expect_only(&keys)?;
        let (weight, mean) = (part.number("n")?, part.number("mean")?);
        merged.merge(&Moments::from_parts(weight, mean, part.number("m2")?)?);
    }
    Ok(merged.variance().into())
}

/// Values and weights, given or made; a weight is 1 where none is named.
fn readings(inputs: Inputs<'_>) -> Result<(Vec<f64>, Vec<f64>), Refusal> {
    if inputs.has("values") == inputs.has("generator") {
        return Err(Refusal::new("expected either values or a generator"));
    }
    if inputs.has("generator") {
        if inputs.has("weights") {
            return Err(Refusal::new("a generator makes its own weights"));
        }
        return generated(inputs.object("generator")?);
    }
    let values = inputs.numbers("values")?;
    let weights =
        if inputs.has("weights") { inputs.numbers("weights")? } else { vec![1.0; values.len()] };
    if weights.len() != values.len() {
        let (found, expected) = (weights.len(), values.len());
        return Err(Refusal::new(format!("there are {found} weights for {expected} values")));
    }
    Ok((values, weights))
}

/// Values and weights by rule, all operations in the order in which they stand.
fn generated(generator: Inputs<'_>) -> Result<(Vec<f64>, Vec<f64>), Refusal> {
    let kind = generator.text("kind")?;
    let keys: &[&'static str] = match kind {
        "stride" => &["kind", "n", "offset", "amp"],
        "repeat" => &["kind", "n", "value"],
        "alternating" => &["kind", "first", "low", "high", "pairs"],
        "harmonic" => &["kind", "n"],
        other => return Err(Refusal::new(format!("the generator kind `{other}` is not known"))),
    };
    let inputs: Vec<Input> = keys.iter().map(|key| Input::new(key, "number")).collect();
    generator.expect_only(&inputs)?;
    let values: Vec<f64> = match kind {
        "stride" => {
            let (offset, amp) = (generator.number("offset")?, generator.number("amp")?);
            let count = generator.count("n", VALUES_MAX)?;
            let values = (0..count).map(|i| offset + amp * ((i * 7919) % 10007) as f64).collect();
            return Ok((values, (0..count).map(|i| 1.0 + (i % 5) as f64).collect()));
        }
        "repeat" => vec![generator.number("value")?; generator.count("n", VALUES_MAX)?],
        "alternating" => {
            let (low, high) = (generator.number("low")?, generator.number("high")?);
            let pairs = generator.count("pairs", VALUES_MAX / 2)?;
            let pairs = (0..pairs).flat_map(|_| [low, high]);
            std::iter::once(generator.number("first")?).chain(pairs).collect()
        }
        _ => (0..generator.count("n", VALUES_MAX)?)
            .map(|i| if i % 2 == 0 { 1.0 } else { -1.0 } / (i + 1) as f64)
            .collect(),
    };
    let weights = vec![1.0; values.len()];
    Ok((values, weights))
}
