//! What a rig file states, in the simulator's own terms: the one place where the two meet.

use crate::rig::{Alignment, Axis, Quantity, Readback, Rig};

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
            // For the source's spectrum: what the host divides by, drawn with both uncertainties.
            responsivity_a_per_w: detector.responsivity / detector.spectral_mismatch,
            u_responsivity_relative: detector
                .u_responsivity_relative
                .hypot(detector.u_spectral_mismatch_relative),
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

/// What `[simulated]` says of the axes' alignment, and what the rig file states of it as uncertain: the
/// simulated rig is off by a draw of both.
pub(crate) fn misaligned(rig: &Rig, stated: sim::Misalignment) -> sim::Misalignment {
    let more = |of: sim::Uncertain, u: f64| sim::Uncertain { u: of.u.hypot(u), ..of };
    let Alignment { u_offset_m: [x, y, z], u_arm_axis_rad, u_beam_rad, u_tilt_rad } = rig.alignment;
    let [at_x, at_y, at_z] = stated.axis_offset_m;
    sim::Misalignment {
        axis_offset_m: [more(at_x, x), more(at_y, y), more(at_z, z)],
        arm_axis_rad: more(stated.arm_axis_rad, u_arm_axis_rad),
        beam_rad: more(stated.beam_rad, u_beam_rad),
        wobble_rad: more(stated.wobble_rad, u_tilt_rad),
        ..stated
    }
}

fn nominal_axis(axis: &Axis) -> sim::NominalAxis {
    sim::NominalAxis {
        channel: axis.channel,
        home: axis.fixed.unwrap_or(0.0),
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
