//! A name for what will be measured: equal for equal sequences, fits and stop rules, whatever the
//! plan's file looks like.
//!
//! FNV-1a, 64 bits (Fowler, Noll and Vo 1991): it tells plans apart, and protects against nobody.

use core::fmt;

use firmware_protocol::Shutter;
use fit::{Outline, Rules, Spans, Symmetry, Wish};

use super::{Plan, Sequence, Step};
use crate::rig::ReadingKind;

const OFFSET_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
const PRIME: u64 = 0x0000_0100_0000_01b3;

/// The name. Shown as 16 hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PlanHash(pub u64);

impl fmt::Display for PlanHash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "fnv1a64:{:016x}", self.0)
    }
}

impl Plan {
    /// The name of this plan, laid out as `sequence`.
    pub fn hash(&self, sequence: &Sequence) -> PlanHash {
        let mut hash = Fnv(OFFSET_BASIS);
        let region = &self.region;
        for edge in [region.x_m.0, region.x_m.1, region.y_m.0, region.y_m.1, region.theta_max_rad] {
            hash.number(edge);
        }
        hash.wish(&self.fit);
        if let Some(outline) = &self.sample {
            let numbers = match *outline {
                Outline::Rectangle { x_m, y_m } => [x_m.0, x_m.1, y_m.0, y_m.1],
                Outline::Disk { centre_m, radius_m } => [centre_m.0, centre_m.1, radius_m, -1.0],
            };
            for number in numbers {
                hash.number(number);
            }
        }
        hash.number(self.stop.exitance_relative.unwrap_or(-1.0));
        hash.number(self.stop.rig_time_max.map_or(-1.0, |time| time.as_secs_f64()));
        if let Some(warm_up) = &self.warm_up {
            hash.number(warm_up.tolerance_relative);
            hash.number(warm_up.over.as_secs_f64());
            hash.number(warm_up.timeout.as_secs_f64());
        }
        if let Some(adaptive) = self.adaptive() {
            let targets = [adaptive.radiance_relative, adaptive.exitance_relative];
            for number in targets.map(|target| target.unwrap_or(-1.0)) {
                hash.number(number);
            }
            hash.number(adaptive.narrowest_feature_deg);
            // Plans without it are called what they were called before there was one.
            if let Some(asked) = adaptive.exitance_within_region_relative {
                hash.number(asked);
            }
        }
        for step in &sequence.steps {
            hash.step(step);
        }
        PlanHash(hash.0)
    }
}

/// The hash of this module, of texts and files: of every part and its length.
pub fn fnv1a64<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> u64 {
    let mut hash = Fnv(OFFSET_BASIS);
    for part in parts {
        hash.integer(part.len() as u64);
        hash.bytes(part);
    }
    hash.0
}

struct Fnv(u64);

impl Fnv {
    /// Degrees alone are hashed as they were when there was nothing else to wish for.
    fn wish(&mut self, wish: &Wish) {
        for degree in [wish.angular_degree, wish.position_degree] {
            self.integer(degree.map_or(u64::MAX, |degree| degree as u64));
        }
        let numbers = [wish.penalty_power, wish.penalty_strength];
        if wish.kind.is_some() || numbers.iter().any(Option::is_some) {
            self.integer(wish.kind.map_or(u64::MAX, |kind| kind as u64));
            for number in numbers {
                self.number(number.unwrap_or(-1.0));
            }
        }
        if let Some(columns) = wish.cosine_columns {
            self.bytes(b"cosine columns");
            self.integer(columns as u64);
        }
        if let Some(Spans { theta, phi, fine }) = wish.spans {
            self.bytes(b"spans");
            for number in [theta, phi, fine.from, fine.to, fine.halvings] {
                self.integer(number as u64);
            }
            if !fine.around.is_none() {
                self.bytes(b"spans of phi");
                for number in [fine.around.from, fine.around.to, fine.around.halvings] {
                    self.integer(number as u64);
                }
            }
        }
        if let Some(spans) = wish.position_spans {
            self.bytes(b"spans in position");
            self.integer(spans as u64);
        }
        let rules = &wish.rules;
        if *rules != Rules::default() {
            let said = |flag: Option<bool>| flag.map_or(2, u8::from);
            self.bytes(&[
                rules.robust as u8,
                u8::from(rules.nonnegative),
                said(rules.drift),
                said(rules.ranges),
            ]);
            if let Some(symmetry) = rules.symmetry {
                self.bytes(symmetry.key().as_bytes());
                if let Symmetry::Plane { phi_rad } | Symmetry::Quadrant { phi_rad } = symmetry {
                    self.number(phi_rad);
                }
            }
        }
    }

    fn step(&mut self, step: &Step) {
        let kind = match step.kind {
            ReadingKind::Dark => 0,
            ReadingKind::Reference => 1,
            ReadingKind::WarmUp => 2,
            ReadingKind::Target { index, repeat } => {
                3 + (u64::from(index) << 2) + (u64::from(repeat) << 34)
            }
        };
        self.integer(kind);
        if let Some(pose) = step.pose {
            for number in [pose.x_m, pose.y_m, pose.theta_rad, pose.phi_rad] {
                self.number(number);
            }
        }
        for counts in step.counts.0 {
            self.bytes(&counts.to_le_bytes());
        }
        let is_closed = step.shutter == Shutter::Closed;
        self.bytes(&[step.gain, u8::from(is_closed), u8::from(step.source_off)]);
        self.number(step.dwell.as_secs_f64());
        if let Some(swept) = step.swept {
            for counts in swept.travel.0 {
                self.bytes(&counts.to_le_bytes());
            }
            self.integer(u64::from(step.id - swept.first));
            self.number(swept.lead.as_secs_f64());
        }
    }

    fn number(&mut self, number: f64) {
        self.bytes(&number.to_bits().to_le_bytes());
    }

    fn integer(&mut self, integer: u64) {
        self.bytes(&integer.to_le_bytes());
    }

    fn bytes(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(PRIME);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fnv_agrees_with_its_authors() {
        for (text, value) in
            [("", OFFSET_BASIS), ("a", 0xaf63_dc4c_8601_ec8c), ("foobar", 0x8594_4171_f739_67e8)]
        {
            let mut hash = Fnv(OFFSET_BASIS);
            hash.bytes(text.as_bytes());
            assert_eq!(hash.0, value, "{text:?}");
        }
    }
}
