//! The largest size of everything that goes over the wire, in postcard's encoding, as constants:
//! so that a message that does not fit a frame does not compile. Fields are listed a second
//! time here; a struct that gains one, or an enum that gains a variant, does not compile either
//! until this file has it.

use heapless::Vec;

use crate::{
    AXES_MAX, AxisCounts, AxisIdentity, AxisMask, Capabilities, Cause, CommandId, Done, Dwell,
    DwellResult, Home, Identity, MoveTo, Rejection, Shutter, Status, Sweep, Tick, Window,
};

/// Has a largest encoding.
pub(crate) trait Bounded {
    /// Its length, bytes.
    const MAX: usize;
}

/// postcard writes integers in groups of seven bits, signed ones zigzagged.
macro_rules! primitive {
    ($($kind:ty: $max:literal),+ $(,)?) => {
        $(impl Bounded for $kind { const MAX: usize = $max; })+
    };
}

macro_rules! structure {
    ($name:ident { $($field:ident: $kind:ty),+ $(,)? }) => {
        impl Bounded for $name {
            const MAX: usize = 0 $(+ <$kind as Bounded>::MAX)+;
        }
        const _: fn($name) = |$name { $($field),+ }| { $(let _: $kind = $field;)+ };
    };
}

macro_rules! wrapper {
    ($($name:ident($kind:ty)),+ $(,)?) => {
        $(
            impl Bounded for $name {
                const MAX: usize = <$kind as Bounded>::MAX;
            }
            const _: fn($name) = |$name(inner)| { let _: $kind = inner; };
        )+
    };
}

/// One byte says which variant.
macro_rules! choice {
    ($name:ident { $($variant:ident $(($($kind:ty),+))?),+ $(,)? }) => {
        impl Bounded for $name {
            const MAX: usize = 1 + largest(&[$(0 $($(+ <$kind as Bounded>::MAX)+)?),+]);
        }
        const _: fn($name) = |value| match value { $($name::$variant { .. })|+ => () };
    };
}

const fn largest(sizes: &[usize]) -> usize {
    let (mut largest, mut at) = (0, 0);
    while at < sizes.len() {
        if sizes[at] > largest {
            largest = sizes[at];
        }
        at += 1;
    }
    largest
}

primitive!(bool: 1, u8: 1, u16: 3, u32: 5, i32: 5, f64: 8);
wrapper!(CommandId(u32), Tick(u32), AxisMask(u8), AxisCounts(Vec<i32, AXES_MAX>));

impl<T: Bounded> Bounded for Option<T> {
    const MAX: usize = 1 + T::MAX;
}

impl<A: Bounded, B: Bounded> Bounded for (A, B) {
    const MAX: usize = A::MAX + B::MAX;
}

impl<T: Bounded, const N: usize> Bounded for Vec<T, N> {
    /// The count takes one byte below 128.
    const MAX: usize = {
        assert!(N < 128);
        1 + N * T::MAX
    };
}

structure!(Home { id: CommandId, axes: AxisMask });
structure!(MoveTo { id: CommandId, targets: AxisCounts });
structure!(Dwell {
    id: CommandId,
    reading: u32,
    gain: u8,
    shutter: Shutter,
    settle_us: u32,
    duration_us: u32,
});
structure!(Sweep {
    id: CommandId,
    reading: u32,
    gain: u8,
    settle_us: u32,
    lead_us: u32,
    readings: u32,
    windows: u16,
    from: AxisCounts,
    step: AxisCounts,
});
structure!(Capabilities { windows: u16 });
structure!(Window {
    id: CommandId,
    index: u16,
    mean: f64,
    variance: f64,
    min: i32,
    max: i32,
    saturated: u32,
    start: AxisCounts,
    moved: AxisCounts,
    start_tick: Tick,
    duration_us: u32,
});
structure!(Identity {
    protocol: (u8, u8),
    boot_id: u32,
    queue_depth: u8,
    lease_ms: u32,
    gains: u8,
    adc_bits: u8,
    adc_rate_hz: u32,
    axes: Vec<AxisIdentity, AXES_MAX>,
});
structure!(AxisIdentity { low: i32, high: i32, speed: u32, acceleration: u32 });
structure!(Status {
    boot_id: u32,
    homed: AxisMask,
    moving: bool,
    fault: Option<Cause>,
    running: Option<CommandId>,
    queued: u8,
    unacknowledged: u8,
    last_id: Option<CommandId>,
    readback: AxisCounts,
    tick: Tick,
});
structure!(Done { id: CommandId, readback: AxisCounts, tick: Tick });
structure!(DwellResult {
    id: CommandId,
    reading: u32,
    gain: u8,
    n: u32,
    mean: f64,
    variance: f64,
    min: i32,
    max: i32,
    saturated: u32,
    start: AxisCounts,
    end: AxisCounts,
    start_tick: Tick,
    end_tick: Tick,
});

choice!(Shutter { Open, Closed });
choice!(Cause {
    Detector,
    HomingMissed(u8),
    LeaseExpired,
    LimitSwitch(u8),
    Stalled(u8),
    Stopped,
});
choice!(Rejection {
    IdReused,
    Faulted(Cause),
    OutsideLimits(u8, i32),
    QueueFull,
    Senseless,
    Unhomed(u8),
    Unsupported,
    TooFast(u8),
    TooManyWindows(u16),
    NoSuchWindow,
});
