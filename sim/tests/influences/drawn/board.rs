//! The true influence of an effect, measured on the board: forced in against left out.

use std::sync::Arc;

use firmware_protocol::{Board, Illumination, Instant, Shutter};
use sim::{BoundUnit, Compiled, SimulatedBoard, Terms, compile};

use super::Weighed;
use super::dice::Dice;
use super::rigs::{Case, Measure, RATE_HZ, REGION};
use crate::bench::counts;

/// θ and φ, degrees; x, metres.
type Pose = [f64; 3];

impl Case {
    /// Compiled with the effect forced in or left out, and nothing else that is random.
    fn compile(&self, is_in: bool, seed: u64) -> Arc<Compiled> {
        // What the axis alone sees has the sharper changes, and the beam has tests of its own.
        let silent = ["shot-noise", "read-noise", "finite-beam"].into_iter();
        let silent = silent.filter(|name| *name != self.effect);
        let mut without: Vec<String> = silent.map(str::to_owned).collect();
        let mut force = Vec::new();
        if is_in { &mut force } else { &mut without }.push(self.effect.to_owned());
        // A drift of the dark current goes on whether that is there or not.
        let terms = Terms { force, without, seed, ..self.terms.clone() };
        let compiled =
            compile(self.scene.clone(), self.nominal.clone(), self.simulated.clone(), &terms);
        Arc::new(compiled.expect("a sound rig"))
    }

    pub(super) fn weighed(&self, dice: &mut Dice) -> Weighed {
        Weighed {
            effect: self.effect.to_owned(),
            bound: self.bound(),
            found: self.true_influence(dice),
            // Of a root mean square of n normal numbers: beyond it once in a million (chi-squared).
            chance: match self.measure {
                Measure::Dwells => 1.18,
                Measure::Seeds | Measure::Moved(_) => 1.8,
                Measure::Poses(_) | Measure::Moments | Measure::Switched | Measure::Sides => {
                    1.0 + 1e-6
                }
            },
            // The converter's counts.
            seen: 1e-8,
        }
    }

    fn bound(&self) -> f64 {
        let compiled = self.compile(true, 1);
        let row = compiled.effects().iter().find(|row| row.name == self.effect).expect("a row");
        assert!(row.included && row.cause.is_some(), "{row:?}");
        let bound = row.bound.expect("a bound");
        assert_eq!(bound.unit, BoundUnit::Relative, "{}", self.effect);
        bound.value
    }

    /// The standard deviation of a dwell's mean in the dark, amperes.
    fn floor_a(&self) -> f64 {
        let detector = &self.nominal.detector;
        let variance = detector.read_noise_a.powi(2) + self.count_a().powi(2) / 12.0;
        (variance / (self.terms.dwell_s * f64::from(RATE_HZ)).max(1.0)).sqrt()
    }

    /// Two readings may differ by a count without any effect: half a count of either's rounding.
    fn influence(&self, with_a: f64, without_a: f64) -> f64 {
        let reading = with_a.abs().max(without_a.abs()).max(self.floor_a());
        ((with_a - without_a).abs() - self.count_a()).max(0.0) / reading
    }

    fn count_a(&self) -> f64 {
        self.nominal.detector.gains[0].full_scale_a / 2.0_f64.powi(31)
    }

    fn true_influence(&self, dice: &mut Dice) -> f64 {
        let pair = |seed| [true, false].map(|is_in| Bench::new(self, &self.compile(is_in, seed)));
        let largest = |values: Vec<f64>| values.into_iter().fold(0.0, f64::max);
        let poses = self.poses(dice);
        match self.measure {
            Measure::Poses(at_s) => {
                let [mut with, mut without] = pair(1);
                let of = |pose: &Pose| {
                    let read = |bench: &mut Bench| {
                        bench.go_to(*pose, 0.0);
                        bench.dwell(0, at_s)
                    };
                    self.influence(read(&mut with), read(&mut without))
                };
                largest(poses.iter().map(of).collect())
            }
            Measure::Moments => {
                let [mut with, mut without] = pair(1);
                let expected = without.dwell(0, 1.0);
                let of = |_| self.influence(with.dwell(0, dice.uniform(1.0, 2.0)), expected);
                largest((0..1500).map(of).collect())
            }
            Measure::Switched => {
                let [mut with, mut without] = pair(1);
                let ranges = [1, 0].into_iter().zip([1.0, 1e4]);
                let of = |(gain, at_s)| {
                    let read = |bench: &mut Bench| {
                        bench.gain = gain;
                        bench.dwell(0, at_s)
                    };
                    self.influence(read(&mut with), read(&mut without))
                };
                largest(ranges.map(of).collect())
            }
            Measure::Dwells => {
                let [mut with, mut without] = pair(1);
                let squares = (0..400).map(|reading| {
                    let expected = without.dwell(reading, 0.0);
                    let noise = with.dwell(reading, 0.0) - expected;
                    (noise / expected.max(self.floor_a())).powi(2)
                });
                (squares.sum::<f64>() / 400.0).sqrt()
            }
            Measure::Seeds => {
                self.rms(&poses[..poses.len() / 8], &mut |bench, pose| bench.go_to(pose, 0.0))
            }
            Measure::Moved(moves) => self.rms(&poses[..8], &mut |bench, pose| {
                let last = f64::from(moves);
                for i in 0..moves {
                    let part = f64::from(i) / last;
                    bench.go_to(pose.map(|joint| joint * part), 0.0);
                }
                bench.go_to(pose, 0.0);
            }),
            Measure::Sides => {
                let [mut with, mut without] = pair(1);
                let of = |pose: &Pose| {
                    let sides = [-1.0, 1.0].map(|side| {
                        let aside = [pose[0] + 20.0 * side, pose[1], pose[2] + 0.01 * side];
                        let read = |bench: &mut Bench| {
                            bench.go_to(aside, 0.0);
                            bench.go_to(*pose, 100.0);
                            bench.dwell(0, 100.0)
                        };
                        self.influence(read(&mut with), read(&mut without))
                    });
                    sides[0].max(sides[1])
                };
                largest(poses.iter().map(of).collect())
            }
        }
    }

    /// All over the region's directions and denser near the normal; or about the outline.
    fn poses(&self, dice: &mut Dice) -> Vec<Pose> {
        if let Some((edge_m, reach_m)) = self.outline_m {
            let aside = |dice: &mut Dice| reach_m * dice.uniform(-1.5, 1.5);
            return (0..400).map(|_| [0.0, 0.0, edge_m + aside(dice)]).collect();
        }
        let theta_max = REGION.theta_max_rad.to_degrees();
        let theta = |dice: &mut Dice| theta_max * dice.decades(-2.0, 0.0);
        let tried = (0..400).map(|_| [theta(dice), dice.uniform(-170.0, 170.0), 0.0]);
        tried.chain([[theta_max, 0.0, 0.0]]).collect()
    }

    /// Over seeds, in the pose where it is the largest, at the end of the run.
    fn rms(&self, poses: &[Pose], go: &mut dyn FnMut(&mut Bench, Pose)) -> f64 {
        const SEEDS: u64 = 24;
        let mut sums = vec![0.0; poses.len()];
        let mut without = Bench::new(self, &self.compile(false, 1));
        let expected: Vec<f64> = poses
            .iter()
            .map(|pose| {
                go(&mut without, *pose);
                without.dwell(0, self.terms.run_s)
            })
            .collect();
        for seed in 0..SEEDS {
            let mut with = Bench::new(self, &self.compile(true, seed));
            for ((pose, expected), sum) in poses.iter().zip(&expected).zip(&mut sums) {
                if matches!(self.measure, Measure::Moved(_)) {
                    with = Bench::new(self, &with.compiled);
                }
                go(&mut with, *pose);
                let influence = self.influence(with.dwell(0, self.terms.run_s), *expected);
                *sum += influence * influence / SEEDS as f64;
            }
        }
        sums.into_iter().fold(0.0, f64::max).sqrt()
    }
}

/// A board whose axes have been homed as the device core would do it.
struct Bench {
    compiled: Arc<Compiled>,
    board: SimulatedBoard,
    gain: u8,
    n: u64,
    counts_per_a: Vec<f64>,
}

impl Bench {
    fn new(case: &Case, compiled: &Arc<Compiled>) -> Self {
        let mut board = SimulatedBoard::new(Arc::clone(compiled), 0);
        for channel in 0..4 {
            let span = f64::from(board.axes()[usize::from(channel)].high) * 2.0;
            board.begin_search(Instant::ZERO, channel);
            board.set_setpoint(Instant::ZERO, channel, -span);
            board.set_setpoint(Instant::ZERO, channel, span);
            let mark = board.home_mark(Instant::ZERO, channel).expect("within the travel");
            board.set_setpoint(Instant::ZERO, channel, mark);
            board.set_home(Instant::ZERO, channel);
        }
        let n = (micros(case.terms.dwell_s) * u64::from(RATE_HZ) / 1_000_000).max(1);
        let gains = &case.nominal.detector.gains;
        let counts_per_a = gains.iter().map(|gain| 2.0_f64.powi(31) / gain.full_scale_a).collect();
        Self { compiled: Arc::clone(compiled), board, gain: 0, n, counts_per_a }
    }

    fn go_to(&mut self, [theta_deg, phi_deg, x_m]: Pose, at_s: f64) {
        let now = Instant::from_micros(micros(at_s));
        for (channel, target) in (0..).zip(counts(theta_deg, phi_deg, x_m, 0.0).0) {
            self.board.begin_motion(now, channel, f64::from(target));
            self.board.set_setpoint(now, channel, f64::from(target));
        }
    }

    /// The mean current, amperes.
    fn dwell(&mut self, reading: u32, at_s: f64) -> f64 {
        let begin = micros(at_s);
        let illumination = Illumination { reading, gain: self.gain, shutter: Shutter::Open };
        self.board.prepare_dwell(Instant::from_micros(begin), illumination);
        self.board.begin_dwell(Instant::from_micros(begin), illumination);
        let mut sum = 0.0;
        for k in 1..=self.n {
            let end = Instant::from_micros(begin + k * 1_000_000 / u64::from(RATE_HZ));
            sum += f64::from(self.board.convert(end).unwrap());
        }
        sum / self.n as f64 / self.counts_per_a[usize::from(self.gain)]
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // of hours at most
fn micros(seconds: f64) -> u64 {
    (seconds * 1e6).round() as u64
}
