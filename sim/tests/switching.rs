//! What could break: an effect whose presence shifts the numbers of another, a reading that depends
//! on the thread that took it, an effect that is left out and runs all the same.

mod bench;

use std::sync::Arc;

use bench::{counts, exact_rig};
use firmware_protocol::{Board, Illumination, Instant, Shutter};
use sim::{
    Compiled, Drift, Emitter, EncoderError, Flicker, GainSwitching, MainsFlicker, MissedSteps,
    Nominal, Quantity, Ringing, Scene, Shape, Simulated, SimulatedBoard, SourceOverTime, Terms,
    Uncertain, WarmUp, compile,
};

/// A rig with everything wrong with it.
#[derive(Clone)]
struct Rig {
    source: SourceOverTime,
    nominal: Nominal,
    simulated: Simulated,
}

/// Sets an effect to a size, 1 being a plain one; 0 takes it away.
type Set = fn(&mut Rig, f64);

const EFFECTS: [(&str, Set); 27] = [
    ("warm-up", |rig, size| {
        let amplitude_relative = 0.2 * size;
        rig.source.warm_up = (size > 0.0).then_some(WarmUp {
            amplitude_relative,
            time_constant_s: 40.0,
            age_s: 0.0,
        });
    }),
    ("mains-flicker", |rig, size| {
        let depth_relative = 0.3 * size;
        rig.source.mains_flicker = (size > 0.0).then_some(MainsFlicker {
            frequency_hz: 93.0,
            depth_relative,
            phase_rad: None,
        });
    }),
    ("stray-light", |rig, size| {
        rig.simulated.detector.stray_light_fraction_of_flux = 1e-6 * size;
    }),
    ("detector-drift", |rig, size| {
        rig.simulated.detector.drift =
            Drift { relative_per_h: 0.1 * size, random_walk_relative_per_root_h: 0.2 * size };
    }),
    ("dark-current", |rig, size| rig.simulated.dark_current_a = 1e-10 * size),
    ("dark-drift", |rig, size| rig.simulated.detector.dark_drift_relative_per_h = size),
    ("read-noise", |rig, size| rig.nominal.detector.read_noise_a = 5e-12 * size),
    ("flicker-noise", |rig, size| {
        let flicker = Flicker { corner_hz: 50.0 * size, lowest_hz: 0.1 };
        rig.simulated.detector.flicker = (size > 0.0).then_some(flicker);
    }),
    ("gain-switching", |rig, size| {
        let stated = GainSwitching { step_relative: 0.01 * size, time_constant_s: 0.1 };
        rig.simulated.detector.gain_switching = (size > 0.0).then_some(stated);
    }),
    ("non-linearity", |rig, size| {
        rig.simulated.detector.non_linearity_relative_at_full_scale = 0.1 * size;
    }),
    ("responsivity", |rig, size| rig.nominal.detector.u_responsivity_relative = 0.01 * size),
    ("pupil-size", |rig, size| rig.nominal.detector.u_pupil_radius_m = 1e-5 * size),
    ("spot-size", |rig, size| rig.nominal.detector.u_spot_radius_m = 1e-5 * size),
    ("distance", |rig, size| rig.nominal.detector.u_distance_m = 1e-3 * size),
    ("gain[1]", |rig, size| rig.nominal.detector.gains[1].u_relative = 0.01 * size),
    ("theta-zero", |rig, size| rig.nominal.axes[0].u_zero = 1e-2 * size),
    ("theta-homing", |rig, size| rig.nominal.axes[0].u_homing = 1e-2 * size),
    ("theta-scale", |rig, size| rig.nominal.axes[0].u_readback = 1e-2 * size),
    ("theta-backlash", |rig, size| rig.simulated.axes[0].backlash = 1e-2 * size),
    ("theta-encoder-error", |rig, size| {
        let error = EncoderError { amplitude: 1e-2 * size, period: 0.3 };
        rig.simulated.axes[0].encoder_error = (size > 0.0).then_some(error);
    }),
    ("theta-settling", |rig, size| {
        rig.simulated.axes[0].settle_s = (size > 0.0).then_some(0.3 * size);
    }),
    ("theta-settle-ringing", |rig, size| {
        let amplitude = 1e-2 * size;
        rig.simulated.axes[0].ringing =
            (size > 0.0).then_some(Ringing { amplitude, frequency_hz: 9.0, damping_ratio: 0.01 });
    }),
    ("theta-missed-steps", |rig, size| {
        let missed = MissedSteps { probability_per_move: 0.3, counts: 40.0 * size };
        rig.simulated.axes[0].missed_steps = (size > 0.0).then_some(missed);
    }),
    ("axis-offset", |rig, size| {
        rig.simulated.misalignment.axis_offset_m[2] =
            Uncertain { value: 1e-2 * size, u: 1e-3 * size };
    }),
    ("non-orthogonality", |rig, size| {
        rig.simulated.misalignment.beam_rad = Uncertain { value: 1e-2 * size, u: 1e-3 * size };
    }),
    ("wobble", |rig, size| {
        rig.simulated.misalignment.wobble_rad = Uncertain { value: 1e-2 * size, u: 1e-3 * size };
    }),
    ("shot-noise", |_, _| {}),
];

/// So small that no count of any reading changes, and not zero.
const NEXT_TO_NOTHING: f64 = 1e-14;

fn full() -> Rig {
    let mut nominal = exact_rig();
    nominal.detector.gains[1].full_scale_a = 3e-7;
    let source = SourceOverTime::default();
    let mut rig = Rig { source, nominal, simulated: Simulated::default() };
    for (_, set) in EFFECTS {
        set(&mut rig, 1.0);
    }
    rig
}

fn scene(source: SourceOverTime) -> Scene {
    let lobe = Emitter::cosine_power(Shape::rectangle(0.0, 0.0, 0.1, 0.1), 9.0, 60.0);
    Scene::new(Quantity::Radiance).with(lobe).unwrap().over_time_as(source)
}

/// With the effects of these names forced in, and the others out.
fn compiled(rig: &Rig, is_in: impl Fn(&str) -> bool, seed: u64) -> Arc<Compiled> {
    let names = |wanted: bool| -> Vec<String> {
        let names = EFFECTS.iter().map(|(name, _)| *name).filter(|name| is_in(name) == wanted);
        names.map(str::to_owned).collect()
    };
    let mut terms = Terms { force: names(true), seed, ..Terms::default() };
    terms.without = names(false);
    // It is neither random nor drawn, and takes time to be weighed.
    terms.without.push("finite-beam".to_owned());
    let scene = scene(rig.source);
    Arc::new(compile(scene, rig.nominal.clone(), rig.simulated.clone(), &terms).expect("sound"))
}

/// Counts of dwells here and there, at both ranges, open and closed.
fn readings(compiled: &Arc<Compiled>) -> Vec<i32> {
    let mut board = SimulatedBoard::new(Arc::clone(compiled), 0);
    let mut us = 0;
    for channel in 0..4 {
        let span = f64::from(board.axes()[usize::from(channel)].high) * 2.0;
        let now = Instant::ZERO;
        board.begin_search(now, channel);
        board.set_setpoint(now, channel, -span);
        board.set_setpoint(now, channel, span);
        let mark = board.home_mark(now, channel).expect("within the travel");
        board.set_setpoint(now, channel, mark);
        board.set_home(now, channel);
    }
    let mut counted = Vec::new();
    for reading in 0..24_u32 {
        let pose = counts(2.5 * f64::from(reading), 7.0 * f64::from(reading), 0.045, -0.045);
        us += 1_000_000;
        for (channel, target) in (0..).zip(pose.0) {
            board.begin_motion(Instant::from_micros(us), channel, f64::from(target));
            board.set_setpoint(Instant::from_micros(us), channel, f64::from(target));
        }
        let shutter = if reading % 5 == 4 { Shutter::Closed } else { Shutter::Open };
        let illumination = Illumination { reading, gain: u8::from(reading % 3 == 1), shutter };
        board.prepare_dwell(Instant::from_micros(us), illumination);
        board.begin_dwell(Instant::from_micros(us), illumination);
        for k in 1..=40 {
            counted.push(board.convert(Instant::from_micros(us + 500 * k)).unwrap());
        }
    }
    counted
}

#[test]
fn the_presence_of_an_effect_shifts_no_other_effects_numbers() {
    // Shot noise has no size of its own: it is there or not.
    for (name, set) in EFFECTS.into_iter().filter(|(name, _)| *name != "shot-noise") {
        let mut absent = full();
        set(&mut absent, 0.0);
        let mut barely = full();
        set(&mut barely, NEXT_TO_NOTHING);
        // Without read noise there is no corner of the flicker noise to speak of, without dark
        // current no drift of it.
        let dependent = match name {
            "read-noise" => "flicker-noise",
            "dark-current" => "dark-drift",
            _ => "",
        };
        for rig in [&mut absent, &mut barely] {
            for (_, set) in EFFECTS.iter().filter(|(other, _)| *other == dependent) {
                set(rig, 0.0);
            }
        }
        let others = |effect: &str| effect != name && effect != dependent;
        let without = readings(&compiled(&absent, others, 7));
        let with = readings(&compiled(&barely, |effect| effect != dependent, 7));
        assert_eq!(with, without, "{name}");
    }
}

#[test]
fn each_effect_shows_when_it_is_switched_on() {
    let rig = full();
    let none = readings(&compiled(&rig, |_| false, 7));
    for (name, _) in EFFECTS {
        // A drift needs something to drift.
        let base = |effect: &str| name == "dark-drift" && effect == "dark-current";
        let without =
            if name == "dark-drift" { readings(&compiled(&rig, base, 7)) } else { none.clone() };
        let with = readings(&compiled(&rig, |effect| effect == name || base(effect), 7));
        assert!(with != without, "{name} changes nothing");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let rig = full();
    let alone = readings(&compiled(&rig, |_| true, 3));
    assert_ne!(alone, readings(&compiled(&rig, |_| true, 4)));
    for threads in [1, 2, 5] {
        let running: Vec<_> = (0..threads)
            .map(|_| {
                let rig = rig.clone();
                std::thread::spawn(move || readings(&compiled(&rig, |_| true, 3)))
            })
            .collect();
        for thread in running {
            assert_eq!(thread.join().unwrap(), alone, "{threads} threads");
        }
    }
}

#[test]
fn what_is_left_out_is_not_there_to_run() {
    let rig = full();
    let stages = |is_in: &dyn Fn(&str) -> bool| {
        let board = SimulatedBoard::new(compiled(&rig, is_in, 1), 0);
        format!("{board:?}").split("stages: ").nth(1).expect("a board has stages").to_owned()
    };
    assert!(stages(&|_| false).starts_with("Stages([])"), "{}", stages(&|_| false));
    for (name, stage) in [
        ("stray-light", "StrayLight"),
        ("warm-up", "WarmingUp"),
        ("mains-flicker", "Flickering"),
        ("detector-drift", "Drifting"),
        ("dark-current", "DarkCurrent"),
        ("dark-drift", "DarkDrift"),
        ("shot-noise", "ShotNoise"),
        ("read-noise", "ReadNoise"),
        ("flicker-noise", "FlickerNoise"),
        ("gain-switching", "Switching"),
        ("non-linearity", "NonLinearity"),
    ] {
        assert!(
            stages(&|effect| effect == name).starts_with(&format!("Stages([{stage}")),
            "{name}"
        );
        let others = stages(&|effect| effect != name);
        assert!(
            !others.contains(&format!("[{stage} {{")) && !others.contains(&format!(", {stage} {{"))
        );
    }
}

#[test]
fn an_axis_that_settles_in_its_stated_time_is_left_out_and_one_that_does_not_is_in() {
    const STATED_S: f64 = 0.05;
    let compiled = |takes_s: Option<f64>, force: &[&str]| {
        let mut nominal = exact_rig();
        nominal.axes[0].settle_s = STATED_S;
        let mut simulated = Simulated::default();
        simulated.axes[0].settle_s = takes_s;
        let force = force.iter().map(|name| (*name).to_owned()).collect();
        let without = vec!["finite-beam".to_owned(), "shot-noise".to_owned()];
        let terms = Terms { force, without, ..Terms::default() };
        let scene = scene(SourceOverTime::default());
        Arc::new(compile(scene, nominal, simulated, &terms).expect("sound"))
    };
    let row = |compiled: &Compiled, name: &str| {
        let row = compiled.effects().iter().find(|row| row.name == name).unwrap();
        (row.included, row.bound.unwrap().value)
    };
    // A move by 30° and a dwell when the stated time is over.
    let reads = |compiled: &Arc<Compiled>| -> Vec<i32> {
        let mut board = SimulatedBoard::new(Arc::clone(compiled), 0);
        let illumination = Illumination { reading: 0, gain: 0, shutter: Shutter::Open };
        for (channel, target) in (0..).zip(counts(30.0, 0.0, 0.0, 0.0).0) {
            board.begin_motion(Instant::ZERO, channel, f64::from(target));
            board.set_setpoint(Instant::ZERO, channel, f64::from(target));
        }
        board.begin_dwell(Instant::from_micros(50_000), illumination);
        (1..=40).map(|k| board.convert(Instant::from_micros(50_000 + 500 * k)).unwrap()).collect()
    };
    for takes_s in [None, Some(STATED_S), Some(0.01)] {
        let settles = compiled(takes_s, &[]);
        assert_eq!(row(&settles, "theta-settling"), (false, 0.0), "{takes_s:?}");
        let forced = compiled(takes_s, &["theta-settling"]);
        assert!(row(&forced, "theta-settling").0);
        assert_eq!(reads(&forced), reads(&settles), "{takes_s:?}");
    }
    let late = compiled(Some(0.08), &[]);
    let (is_in, bound) = row(&late, "theta-settling");
    assert!(is_in && bound > 1e-4, "{bound}");
    assert!(row(&late, "motion-smear").1 > 0.0);
    let (found, rest) = (reads(&late), reads(&compiled(None, &[])));
    assert_ne!(found[0], rest[0], "it still comes in");
}
