//! One call of a kernel of `radiometry`, ready to be made again and again: by the quantity's name
//! in `gonio calc` and the inputs of a reference case, which are read beforehand, so that what is
//! timed is the kernel and no JSON. What changes from call to call (receiver, ray, incidence) is
//! built within the call; what stays (polygon, disk, interface) is built before it.

mod angles;
mod light;
mod rays;

use serde_json::Value;

use crate::Unmeasured;
pub use gonio::study::arithmetic::kernel::{Call, Kind, Row, estimated, value};

/// What any case may take.
pub const HARD_AIM_NS: f64 = 20_000.0;

/// The kernel of a quantity on the inputs of a case; `None` if the quantity isn't `radiometry`'s,
/// or takes a list whose length decides its time.
pub fn call(quantity: &str, inputs: &Value) -> Result<Option<Call>, Unmeasured> {
    if let Some(call) = gonio::study::arithmetic::kernel::call(quantity, inputs)? {
        return Ok(Some(call));
    }
    let row = Row::new(inputs);
    let families = [angles::call, light::call, rays::call];
    for family in families {
        if let Some(call) = family(quantity, row)? {
            return Ok(Some(call));
        }
    }
    Ok(None)
}
