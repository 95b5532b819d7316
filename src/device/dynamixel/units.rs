//! A servo's units: steps of its encoder, and the multiples in which it takes speeds and
//! accelerations. It knows no axis: how many steps make a radian the rig file says.
//!
//! Source: the maker's e-manual, X series: 4096 steps a turn; velocity in 0.229 turns a minute;
//! acceleration in 214.577 turns a minute squared.

/// Steps of the encoder in a turn of the output.
pub(super) const STEPS_A_TURN: i32 = 4096;
/// The farthest goal of a servo that counts turns, steps: 256 turns either way.
pub(super) const STEPS_MAX: i32 = 1_048_575;

/// One unit of the velocity registers, steps a second: 15.6.
pub(super) const VELOCITY_STEPS_PER_S: f64 = 0.229 * 4096.0 / 60.0;
/// One unit of the acceleration registers, steps a second squared: 244.1.
pub(super) const ACCELERATION_STEPS_PER_S2: f64 = 214.577 * 4096.0 / 3600.0;
/// The largest number that either register takes.
const PROFILE_MAX: u32 = 32_767;

/// So many steps a second in the register's units, none too many; at least 1, since 0 means "as
/// fast as it can".
pub(super) fn velocity_units(steps_per_s: u32) -> u32 {
    units(steps_per_s, VELOCITY_STEPS_PER_S)
}

/// The same of an acceleration, steps a second squared.
pub(super) fn acceleration_units(steps_per_s2: u32) -> u32 {
    units(steps_per_s2, ACCELERATION_STEPS_PER_S2)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // of 32 bits, by more than 1
fn units(steps: u32, unit: f64) -> u32 {
    // A speed that is the register's own, rounded down to whole steps, is meant as that.
    ((f64::from(steps) + 1.0) / unit).floor().clamp(1.0, f64::from(PROFILE_MAX)) as u32
}

/// What a register's number comes to, whole steps, none too many.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
pub(super) fn whole_steps(units: u32, unit: f64) -> u32 {
    (f64::from(units) * unit).floor() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profiles_are_never_faster_than_asked_by_more_than_a_step() {
        for steps in (0..40_000).chain([500_000, u32::MAX]) {
            let velocity = f64::from(velocity_units(steps)) * VELOCITY_STEPS_PER_S;
            let is_slowest = velocity_units(steps) == 1;
            assert!(velocity <= f64::from(steps) + 1.0 || is_slowest, "{steps}: {velocity}");
            let acceleration = f64::from(acceleration_units(steps)) * ACCELERATION_STEPS_PER_S2;
            assert!(acceleration <= f64::from(steps) + 1.0 || acceleration_units(steps) == 1);
        }
        assert_eq!(velocity_units(u32::MAX), 32_767);
    }

    #[test]
    fn what_a_register_comes_to_is_that_register_again() {
        for units in 1..=1023 {
            assert_eq!(velocity_units(whole_steps(units, VELOCITY_STEPS_PER_S)), units);
            let acceleration = whole_steps(units, ACCELERATION_STEPS_PER_S2);
            assert_eq!(acceleration_units(acceleration), units);
        }
    }

    /// A turn a second: 60 turns a minute in units of 0.229.
    #[test]
    fn a_turn_a_second_is_262_units() {
        assert_eq!(velocity_units(4096), 262);
        assert_eq!(acceleration_units(4096), 16);
    }
}
