//! What a rig file states, in the simulator's own terms: the one place where the two meet.

use crate::rig::{Axis, Quantity, Readback, Rig};

/// The rig as the simulator takes it: SI units and counts, no drawn truth yet.
pub(crate) fn nominal(rig: &Rig) -> sim::Nominal {
    let detector = &rig.detector;
    sim::Nominal {
        quantity: match detector.quantity {
            Quantity::Luminance => sim::Quantity::Luminance,
            Quantity::Radiance => sim::Quantity::Radiance,
            Quantity::Relative => sim::Quantity::Relative,
        },
        axes: rig.axes.each_ref().map(nominal_axis),
        detector: sim::NominalDetector {
            distance_m: detector.distance_m,
            u_distance_m: detector.u_distance_m,
            pupil_radius_m: detector.pupil_radius_m,
            u_pupil_radius_m: detector.u_pupil_radius_m,
            spot_radius_m: detector.spot_radius_m,
            u_spot_radius_m: detector.u_spot_radius_m,
            responsivity_a_per_w: detector.responsivity,
            u_responsivity_relative: detector.u_responsivity_relative,
            read_noise_a: detector.read_noise_a,
            gains: detector
                .gains
                .iter()
                .map(|gain| sim::NominalGain {
                    name: gain.name.clone(),
                    full_scale_a: gain.full_scale_a,
                    u_relative: gain.u_relative,
                })
                .collect(),
            adc_bits: detector.adc.bits,
            adc_rate_hz: detector.adc.rate_hz,
        },
    }
}

fn nominal_axis(axis: &Axis) -> sim::NominalAxis {
    sim::NominalAxis {
        channel: axis.channel,
        counts_per_unit: axis.counts_per_unit,
        travel_counts: axis.count_limits(),
        speed_counts_per_s: axis.counts_per_s(),
        acceleration_counts_per_s2: axis.counts_per_s2(),
        settle_s: axis.settle.as_secs_f64(),
        has_encoder: matches!(axis.readback, Readback::Encoder),
        u_zero: axis.u_zero,
        u_homing: axis.u_homing,
        u_readback: axis.u_readback,
    }
}
