//! Move times and the device's clock, answered by the motion core and the link themselves.

use firmware_protocol::{Tick, TickUnwrapper, Trapezoid};
use serde_json::Value;

use super::inputs::Inputs;
use super::quantity::{Answer, Input, Quantity, Refusal, Rounding};

/// More ticks than a device sends in a day of microseconds.
const TICKS_MAX: usize = 100_000_000;

pub(super) const QUANTITIES: &[Quantity] = &[
    Quantity {
        name: "trapezoidal-move-time",
        inputs: &[
            Input::new("distance", "m"),
            Input::new("vmax", "m/s"),
            Input::new("amax", "m/s²"),
        ],
        unit: "s",
        example: "--distance 2 --vmax 0.5 --amax 1",
        rounding: Rounding::Relative(1e-15),
        compute: |inputs| Ok(profile(inputs)?.duration_s().into()),
    },
    Quantity {
        name: "trapezoidal-remaining",
        inputs: &[
            Input::new("distance", "m"),
            Input::new("vmax", "m/s"),
            Input::new("amax", "m/s²"),
            Input::new("time", "s since the start"),
        ],
        unit: "m",
        example: "--distance 2 --vmax 0.5 --amax 1 --time 4.25",
        rounding: Rounding::Relative(1e-14),
        compute: |inputs| {
            let time_s = inputs.number("time")?;
            if time_s < 0.0 {
                return Err(Refusal::new(format!("time is {time_s}, expected 0 or more")));
            }
            Ok(profile(inputs)?.remaining(time_s).into())
        },
    },
    Quantity {
        name: "unwrap-u32-microseconds",
        inputs: &[
            Input::optional("ticks", "list of whole numbers below 2^32, µs"),
            Input::optional("generator", "{start, step, n}: start + i·step modulo 2^32"),
        ],
        unit: "s",
        example: "--ticks [4294967290,5]",
        rounding: Rounding::Relative(2.3e-16),
        compute: unwrap,
    },
];

fn profile(inputs: Inputs<'_>) -> Result<Trapezoid, Refusal> {
    let (distance, speed) = (inputs.number("distance")?, inputs.number("vmax")?);
    let acceleration = inputs.number("amax")?;
    Trapezoid::new(distance, speed, acceleration).ok_or_else(|| {
        Refusal::new(format!(
            "there is no move over distance {distance} at vmax {speed} and amax {acceleration}: \
             expected a distance of 0 or more and limits above 0"
        ))
    })
}

fn unwrap(inputs: Inputs<'_>) -> Result<Answer, Refusal> {
    let mut unwrapper = TickUnwrapper::default();
    let mut micros = 0;
    if inputs.has("ticks") == inputs.has("generator") {
        return Err(Refusal::new("expected either ticks or a generator"));
    }
    if inputs.has("ticks") {
        let ticks = inputs.numbers("ticks")?;
        if ticks.is_empty() {
            return Err(Refusal::new("ticks is empty, expected at least one"));
        }
        for value in ticks {
            micros = unwrapper.unwrap(tick(value)?);
        }
    } else {
        let generator = inputs.object("generator")?;
        generator.expect_only(&[
            Input::new("start", "µs"),
            Input::new("step", "µs"),
            Input::new("n", "1"),
        ])?;
        let word = i64::from(u32::MAX);
        let start = generator.integer("start", 0, word)?;
        let step = generator.integer("step", -word, word)?;
        let count = generator.count("n", TICKS_MAX)?;
        if count == 0 {
            return Err(Refusal::new("n is 0, expected at least one tick"));
        }
        let mut value = start;
        for _ in 0..count {
            micros = unwrapper.unwrap(tick(value as f64)?);
            value = (value + step).rem_euclid(word + 1);
        }
    }
    Ok((micros as f64 / 1e6).into())
}

fn tick(value: f64) -> Result<Tick, Refusal> {
    let number = Value::from(value);
    if value.fract() != 0.0 || !(0.0..=f64::from(u32::MAX)).contains(&value) {
        let expected = "expected whole microseconds below 2^32";
        return Err(Refusal::new(format!("a tick is {number}, {expected}")));
    }
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "whole, and in range"
    )]
    Ok(Tick(value as u32))
}
