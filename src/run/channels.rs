//! Between the rig's axes and the device's channels: the same counts, in another order.

use std::time::Duration;

use firmware_protocol::{AxisCounts, AxisMask, SweepMotion};

use crate::rig::{Approach, Flight, Latched, Rig, Route, set_out};

/// A device has one channel an axis: [`crate::device::check_identity`] saw to that.
pub(super) fn to_channels(rig: &Rig, counts: Latched) -> AxisCounts {
    let mut by_channel = AxisCounts(counts.0.iter().map(|_| 0).collect());
    for (axis, count) in rig.axes.iter().zip(counts.0) {
        if let Some(slot) = by_channel.0.get_mut(usize::from(axis.channel)) {
            *slot = count;
        }
    }
    by_channel
}

/// A channel that the device did not report reads 0.
pub(super) fn to_axes(rig: &Rig, counts: &AxisCounts) -> Latched {
    Latched(std::array::from_fn(|i| {
        counts.0.get(usize::from(rig.axes[i].channel)).copied().unwrap_or_default()
    }))
}

/// The channels of all axes.
pub(super) fn all_axes(rig: &Rig) -> AxisMask {
    AxisMask(rig.axes.iter().fold(0, |mask, axis| mask | 1 << axis.channel))
}

/// The way to a pose; from `None`, which is nobody knows where, every axis may come from its
/// wrong side.
pub(super) fn route(rig: &Rig, from: Option<Latched>, to: Latched) -> Route {
    rig.route(from.unwrap_or_else(|| wrong_sides(rig, to)), to)
}

/// The way to where a flight sets out; from `None` as for [`route`].
pub(super) fn route_to_flight(
    rig: &Rig,
    from: Option<Latched>,
    flight: Flight,
    motion: &SweepMotion,
) -> Route {
    rig.route_to_flight(from.unwrap_or_else(|| wrong_sides(rig, set_out(motion))), flight, motion)
}

/// Where every axis would come to a place from its wrong side.
fn wrong_sides(rig: &Rig, to: Latched) -> Latched {
    Latched(std::array::from_fn(|i| match rig.axes[i].approach {
        Approach::Negative => to.0[i].saturating_sub(1),
        Approach::Either | Approach::Positive => to.0[i].saturating_add(1),
    }))
}

/// Whole microseconds, as they go over the wire.
pub(super) fn micros(duration: Duration) -> u32 {
    u32::try_from(duration.as_micros()).unwrap_or(u32::MAX)
}
