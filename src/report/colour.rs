//! A colour map of even steps: equal differences of a number look equally different, also without
//! colour vision and on a grey printer. The nine anchors are those of viridis (van der Walt and
//! Smith 2015, CC0); straight lines in sRGB between them stay within 4 units of the full table.

/// From low to high.
const ANCHORS: [[f64; 3]; 9] = [
    [68.0, 1.0, 84.0],
    [71.0, 45.0, 123.0],
    [59.0, 82.0, 139.0],
    [44.0, 114.0, 142.0],
    [33.0, 145.0, 140.0],
    [39.0, 173.0, 129.0],
    [92.0, 200.0, 99.0],
    [170.0, 220.0, 50.0],
    [253.0, 231.0, 37.0],
];

/// Steps of a map's colours: one path each.
pub(super) const LEVELS: usize = 64;

/// The colour of a step, `#rrggbb`.
pub(super) fn of_level(level: usize) -> String {
    let place = level.min(LEVELS - 1) as f64 / (LEVELS - 1) as f64 * (ANCHORS.len() - 1) as f64;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 8
    let below = (place as usize).min(ANCHORS.len() - 2);
    let part = place - below as f64;
    let channels = ANCHORS[below]
        .iter()
        .zip(ANCHORS[below + 1])
        .map(|(low, high)| libm::round(low + part * (high - low)));
    channels.fold(String::from("#"), |text, channel| {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 255
        let channel = channel as u8;
        format!("{text}{channel:02x}")
    })
}

/// The step of a value between two ends; what lies beyond them has the end's.
pub(super) fn level(value: f64, (low, high): (f64, f64)) -> usize {
    let part = if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.5 };
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to LEVELS
    let level = (part * LEVELS as f64) as usize;
    level.min(LEVELS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// CIE 1976 lightness of an sRGB colour (IEC 61966-2-1).
    fn lightness(colour: &str) -> f64 {
        let channel = |at: usize| {
            let v = f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
        };
        let y = 0.2126 * channel(1) + 0.7152 * channel(3) + 0.0722 * channel(5);
        116.0 * y.cbrt() - 16.0
    }

    #[test]
    fn lightness_rises_evenly() {
        let steps: Vec<f64> = (0..LEVELS).map(|level| lightness(&of_level(level))).collect();
        let even = (steps[LEVELS - 1] - steps[0]) / (LEVELS - 1) as f64;
        for pair in steps.windows(2) {
            let step = pair[1] - pair[0];
            assert!((0.3..2.0).contains(&(step / even)), "{step} beside {even}");
        }
    }

    #[test]
    fn ends_and_equal_ends_have_a_colour() {
        assert_eq!(of_level(level(-1.0, (0.0, 1.0))), "#440154");
        assert_eq!(of_level(level(2.0, (0.0, 1.0))), "#fde725");
        assert_eq!(level(3.0, (3.0, 3.0)), LEVELS / 2);
    }
}
