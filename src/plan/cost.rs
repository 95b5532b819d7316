//! What a sequence will cost in rig time.

/// Rig time, part by part, and the way.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Prediction {
    /// Targets of the plan, each counted once.
    pub targets: u32,
    /// Readings of all kinds, repeats included.
    pub readings: u32,
    /// How far each axis travels, radians, radians, metres, metres, in the order of
    /// [`crate::rig::AXES`].
    pub travel: [f64; 4],
    /// Finding the home marks at the start.
    pub homing_s: f64,
    /// Moving, between all readings.
    pub moving_s: f64,
    /// Waiting for axes to be still.
    pub settling_s: f64,
    /// Integrating at targets.
    pub dwelling_s: f64,
    /// Integrating dark and reference readings.
    pub checking_s: f64,
}

impl Prediction {
    /// The whole, seconds, without a warm-up, whose length is the source's to decide.
    pub fn total_s(&self) -> f64 {
        self.homing_s + self.moving_s + self.settling_s + self.dwelling_s + self.checking_s
    }
}
