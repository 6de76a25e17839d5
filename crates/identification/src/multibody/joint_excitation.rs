//! Motions of joints that show what is asked of a tree.
//!
//! Each joint moves along a Fourier series of one period, scaled so that it uses its tightest limit and exceeds none at any
//! time: a trigonometric polynomial of degree N that is sampled at M points is nowhere larger than its largest sample
//! divided by cos(pi N / M). The series that make the information of one period largest (D-optimality over the base
//! parameters) are looked for by random steps of adapted length.

use super::base_parameters::BaseParameters;
use super::layout::{ParameterLayout, UnknownBody};
use super::link_information::LinkInformation;
use super::momentum_rows::{VelocityNoise, momentum_rows};
use super::torque_rows::torque_rows;
use super::tree_part::{TreePart, completed, known_part};
use super::tree_sample::{TreeAcceleration, TreeSample};
use crate::body_scale::BodyScale;
use crate::dynamics::{BodyAcceleration, Multibody};
use crate::error::IdentificationError;
use crate::lie::{LieGroup, Pose, Twist, Wrench};
use crate::noise::unit_interval;
use nalgebra::{DMatrix, DVector, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::f64::consts::{PI, TAU};

/// Samples of the limits per harmonic; the bound between them is 0.5 % above the largest.
const LIMIT_SAMPLES: usize = 32;
/// Samples of the information per harmonic.
const INFORMATION_SAMPLES: usize = 12;
/// Random motions at first; the search goes on from the best.
const CANDIDATES: usize = 20;

/// What a joint may do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointRange {
    /// Smallest position, rad or m.
    pub lower: f64,
    /// Largest position.
    pub upper: f64,
    /// Largest rate, rad/s or m/s.
    pub rate: f64,
    /// Largest acceleration, rad/s^2 or m/s^2; infinite where nothing limits it.
    pub acceleration: f64,
}

/// What the base does meanwhile, and so which equations are used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ExcitedBase {
    /// Held in this gravity, base axes: torques of the joints.
    Fixed(Vector3<f64>),
    /// Floating with this momentum about the inertial origin: momentum, with this noise of the velocities.
    Floating(Wrench<f64>, VelocityNoise),
}

/// What is to be shown, by which joints.
#[derive(Clone, Debug, PartialEq)]
pub struct JointExcitation {
    /// The tree with the bodies that are known.
    pub tree: Multibody<f64>,
    /// The parts asked for; their nominal bodies are what is moved. Payloads are carried.
    pub parts: Vec<TreePart>,
    /// Limits, one a joint.
    pub ranges: Vec<JointRange>,
    /// What the base does.
    pub base: ExcitedBase,
    /// Length of a period, s.
    pub period_s: f64,
    /// Harmonics of the period.
    pub harmonics: usize,
}

/// A periodic motion of joints.
#[derive(Clone, Debug, PartialEq)]
pub struct JointMotion {
    /// Length of a period, s.
    pub period_s: f64,
    /// Middle of each joint's motion.
    pub middles: Vec<f64>,
    /// Of each joint, sine and cosine of each harmonic.
    pub coefficients: Vec<Vec<[f64; 2]>>,
}

impl JointMotion {
    /// Position, rate and acceleration of a joint; zero for one there is not.
    pub fn at(&self, joint: usize, time_s: f64) -> [f64; 3] {
        let Some(coefficients) = self.coefficients.get(joint) else { return [0.0; 3] };
        let [value, rate, acceleration] = series(coefficients, self.period_s, time_s);
        [self.middles.get(joint).copied().unwrap_or(0.0) + value, rate, acceleration]
    }
}

fn series(coefficients: &[[f64; 2]], period_s: f64, time_s: f64) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for (k, [sine, cosine]) in coefficients.iter().enumerate() {
        let frequency = TAU * (k + 1) as f64 / period_s;
        let (s, c) = (frequency * time_s).sin_cos();
        let (value, rate) = (sine * s + cosine * c, frequency * (sine * c - cosine * s));
        sum[0] += value;
        sum[1] += rate;
        sum[2] -= frequency * frequency * value;
    }
    sum
}

/// A designed motion and what it is worth.
#[derive(Clone, Debug, PartialEq)]
pub struct JointDesign {
    /// The motion.
    pub motion: JointMotion,
    /// Base parameters that motions of these joints show.
    pub rank: usize,
    /// Condition number of one period's equations over them, like units.
    pub condition_number: f64,
    /// The same of each random motion at first.
    pub condition_of_random: Vec<f64>,
    /// Mean gain over the best random motion: by this factor the standard deviations are smaller (geometric mean).
    pub gain: f64,
}

impl JointExcitation {
    /// The best motion found in so many `trials`; the same seed gives the same motion.
    ///
    /// # Errors
    /// [`IdentificationError::InvalidPeriod`], [`IdentificationError::NoHarmonics`], lists that do not fit the tree,
    /// [`IdentificationError::NotPositive`] for a limit that leaves no room, [`IdentificationError::NotExcited`] where no motion
    /// of these joints shows anything.
    pub fn design(&self, trials: usize, seed: u64) -> Result<JointDesign, IdentificationError> {
        self.check()?;
        let mut generator = ChaCha8Rng::seed_from_u64(seed);
        let count = 2 * self.harmonics * self.ranges.len();
        let mut draw = || (0..count).map(|_| gaussian(&mut generator)).collect::<Vec<f64>>();
        let random: Vec<Vec<f64>> = (0..CANDIDATES).map(|_| draw()).collect();
        let all =
            random.iter().map(|numbers| self.information(&self.motion(numbers))).collect::<Result<Vec<_>, _>>()?;
        let mut together = self.empty()?;
        for information in &all {
            together.merge(information)?;
        }
        let layout = self.layout()?;
        let base = BaseParameters::new(&together, &layout)?;
        if base.rank() == 0 {
            let (rank, expected) = (0, layout.unknowns());
            return Err(IdentificationError::NotExcited { rank, expected, smallest_singular_value: 0.0 });
        }
        let space = DMatrix::from_diagonal(&layout.magnitudes()) * base.row_space();
        let judge = |information: &LinkInformation| singular_values(information, &space);
        let logarithm = |values: &DVector<f64>| values.iter().map(|value| value.ln()).sum::<f64>();
        let condition = |values: &DVector<f64>| values.max() / values.min();
        let judged: Vec<DVector<f64>> = all.iter().map(judge).collect();
        let first = (0..CANDIDATES).max_by(|&a, &b| logarithm(&judged[a]).total_cmp(&logarithm(&judged[b])));
        let first = first.unwrap_or(0);
        let start = logarithm(&judged[first]);
        let (mut numbers, mut best, mut values) = (random[first].clone(), start, judged[first].clone());
        let mut length = 0.3;
        for _ in 0..trials {
            let candidate: Vec<f64> =
                numbers.iter().zip(draw_like(&mut generator, count)).map(|(x, step)| x + length * step).collect();
            let found = judge(&self.information(&self.motion(&candidate))?);
            // a fifth of the steps should succeed
            if logarithm(&found) > best {
                (numbers, best, values) = (candidate, logarithm(&found), found);
                length = (length * 1.5).min(1.0);
            } else {
                length = (length * 0.9).max(1e-4);
            }
        }
        Ok(JointDesign {
            motion: self.motion(&numbers),
            rank: base.rank(),
            condition_number: condition(&values),
            condition_of_random: judged.iter().map(condition).collect(),
            gain: ((best - start) / base.rank() as f64).exp(),
        })
    }

    fn check(&self) -> Result<(), IdentificationError> {
        let joints = self.tree.joints();
        if !(self.period_s > 0.0 && self.period_s.is_finite()) {
            return Err(IdentificationError::InvalidPeriod { period_s: self.period_s });
        }
        if self.harmonics == 0 {
            return Err(IdentificationError::NoHarmonics);
        }
        if self.ranges.len() != joints {
            let found = self.ranges.len();
            return Err(crate::dynamics::DynamicsError::JointCount { expected: joints, found }.into());
        }
        for (index, range) in self.ranges.iter().enumerate() {
            for value in [range.upper - range.lower, range.rate, range.acceleration] {
                if value.is_nan() || value <= 0.0 {
                    return Err(IdentificationError::NotPositive { index, value });
                }
            }
        }
        Ok(())
    }

    /// The motion of these free numbers: each joint scaled to its tightest limit.
    fn motion(&self, numbers: &[f64]) -> JointMotion {
        let samples = LIMIT_SAMPLES * self.harmonics;
        let between = (PI * self.harmonics as f64 / samples as f64).cos();
        let scaled = |(range, own): (&JointRange, &[f64])| -> Vec<[f64; 2]> {
            // higher harmonics smaller, so that rates do not drown positions
            let raw: Vec<[f64; 2]> = own
                .chunks_exact(2)
                .enumerate()
                .map(|(k, pair)| [pair[0] / (k + 1) as f64, pair[1] / (k + 1) as f64])
                .collect();
            let mut largest = [0.0_f64; 3];
            for sample in 0..samples {
                let at = series(&raw, self.period_s, self.period_s * sample as f64 / samples as f64);
                for (largest, value) in largest.iter_mut().zip(at) {
                    *largest = largest.max(value.abs() / between);
                }
            }
            let limits = [0.5 * (range.upper - range.lower), range.rate, range.acceleration];
            let factor =
                limits.iter().zip(largest).map(|(limit, largest)| limit / largest).fold(f64::INFINITY, f64::min);
            let factor = if factor.is_finite() { factor } else { 0.0 };
            raw.into_iter().map(|[sine, cosine]| [sine * factor, cosine * factor]).collect()
        };
        JointMotion {
            period_s: self.period_s,
            middles: self.ranges.iter().map(|range| 0.5 * (range.lower + range.upper)).collect(),
            coefficients: self.ranges.iter().zip(numbers.chunks_exact(2 * self.harmonics)).map(scaled).collect(),
        }
    }

    fn layout(&self) -> Result<ParameterLayout, IdentificationError> {
        let body = |part: &TreePart| {
            Ok(UnknownBody { name: part.name.clone(), scale: BodyScale::of(&part.nominal.to_vector())? })
        };
        ParameterLayout::try_new(self.parts.iter().map(body).collect::<Result<_, IdentificationError>>()?, Vec::new())
    }

    fn empty(&self) -> Result<LinkInformation, IdentificationError> {
        Ok(LinkInformation::new(self.layout()?.unknowns()))
    }

    /// What one period says.
    fn information(&self, motion: &JointMotion) -> Result<LinkInformation, IdentificationError> {
        let mut information = self.empty()?;
        let known = known_part(&self.tree, &self.parts);
        let numbers: Vec<f64> = self.parts.iter().flat_map(|part| part.nominal.to_vector().data.0[0]).collect();
        let moved = completed(&known, &self.parts, &numbers, true);
        let samples = INFORMATION_SAMPLES * self.harmonics;
        let step_s = self.period_s / samples as f64;
        let joints = |time_s: f64| (0..self.ranges.len()).map(|joint| motion.at(joint, time_s)).collect::<Vec<_>>();
        let mut pose = Pose::identity();
        for sample in 0..samples {
            let time_s = sample as f64 * step_s;
            let now = joints(time_s);
            let list = |k: usize, from: &[[f64; 3]]| from.iter().map(|joint| joint[k]).collect::<Vec<f64>>();
            let mut instant = TreeSample {
                time_s,
                world_from_base: pose,
                base_twist: Twist::zero(),
                positions: list(0, &now),
                rates: list(1, &now),
                accelerations: None,
                motors: None,
                base_wrench: None,
            };
            match &self.base {
                ExcitedBase::Fixed(gravity) => {
                    let base = BodyAcceleration {
                        angular_acceleration_body: Vector3::zeros(),
                        acceleration_origin_body: -gravity,
                    };
                    instant.accelerations = Some(TreeAcceleration { base, joints: list(2, &now) });
                    if let Some(rows) = torque_rows(&known, &self.parts, true, &[], &instant)? {
                        let right = vec![0.0; rows.joints.nrows()];
                        information.add_rows(rows.joints.transpose().as_slice(), &right)?;
                    }
                }
                ExcitedBase::Floating(momentum, noise) => {
                    let twist = |pose: &Pose<f64>, at: &[[f64; 3]]| {
                        let about_base = momentum.transformed_by(&LieGroup::inverse(pose));
                        moved.floating_base_twist(&list(0, at), &list(1, at), &about_base)
                    };
                    instant.base_twist = twist(&pose, &now)?;
                    let parts = (self.parts.as_slice(), numbers.as_slice());
                    let rows = momentum_rows(&moved, parts, true, &instant, (&pose, noise), momentum, true)?;
                    information.add_rows(rows.regressor.transpose().as_slice(), &[0.0; 6])?;
                    let half = pose * Pose::exp(&(instant.base_twist.to_vector() * (0.5 * step_s)));
                    let middle = twist(&half, &joints(time_s + 0.5 * step_s))?;
                    pose *= Pose::exp(&(middle.to_vector() * step_s));
                }
            }
        }
        Ok(information)
    }
}

/// Signal to noise of the directions in `space` over one period.
fn singular_values(information: &LinkInformation, space: &DMatrix<f64>) -> DVector<f64> {
    (information.factor() * space).singular_values().map(|value| value.max(f64::MIN_POSITIVE))
}

fn gaussian(generator: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || unit_interval(generator);
    let (radius, angle) = (1.0 - uniform(), uniform());
    (-2.0 * radius.ln()).sqrt() * (TAU * angle).cos()
}

fn draw_like(generator: &mut ChaCha8Rng, count: usize) -> Vec<f64> {
    (0..count).map(|_| gaussian(generator)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::{InertialParameters, Joint, Link};
    use nalgebra::Matrix3;

    fn ball(kg: f64, x: f64) -> InertialParameters<f64> {
        InertialParameters::about_com(kg, Vector3::new(x, 0.01, 0.0), Matrix3::identity() * (kg * 0.01))
    }

    fn arm() -> Multibody<f64> {
        let joint = |axis: Vector3<f64>, x: f64| Joint::revolute(axis, Pose::translation(x, 0.0, 0.0)).unwrap();
        let links = vec![
            Link { parent: None, joint: joint(Vector3::y(), 0.1), body: ball(0.5, 0.1) },
            Link { parent: Some(0), joint: joint(Vector3::z(), 0.2), body: ball(0.4, 0.1) },
        ];
        Multibody::try_new(ball(9.0, 0.0), links).unwrap()
    }

    fn problem(base: ExcitedBase) -> JointExcitation {
        let range = |rate: f64| JointRange { lower: -1.5, upper: 1.0, rate, acceleration: 2.0 };
        let parts = match base {
            ExcitedBase::Fixed(_) => {
                (1..3).map(|body| TreePart::whole(format!("link{body}"), body, *arm().body(body).unwrap())).collect()
            }
            ExcitedBase::Floating(..) => vec![TreePart::payload("payload", 2, Pose::identity(), ball(1.0, 0.1))],
        };
        JointExcitation { tree: arm(), parts, ranges: vec![range(0.8), range(0.5)], base, period_s: 20.0, harmonics: 4 }
    }

    fn noise() -> VelocityNoise {
        VelocityNoise { base_rate_rad_s: 1e-3, base_velocity_m_s: 1e-3, joint_rate: 1e-4 }
    }

    #[test]
    fn designed_motions_are_worth_more_than_random_ones_and_keep_every_limit() {
        // of two crossed hinges three numbers of the first link show (one inertia, two moments) and seven of the second
        for (base, rank) in [
            (ExcitedBase::Fixed(Vector3::new(0.0, 0.0, -9.81)), 10),
            (ExcitedBase::Floating(Wrench::zero(), noise()), 10),
        ] {
            let problem = problem(base);
            let design = problem.design(300, 1).unwrap();
            assert_eq!(design.rank, rank);
            assert!(design.gain > 1.15, "{} {:?}", design.gain, design.condition_of_random);
            assert_eq!(design, problem.design(300, 1).unwrap());
            assert_ne!(design.motion, problem.design(300, 2).unwrap().motion);
            for (joint, range) in problem.ranges.iter().enumerate() {
                let mut used = 0.0_f64;
                for k in 0..20_000 {
                    let [q, rate, acceleration] = design.motion.at(joint, 20.0 * f64::from(k) / 20_000.0);
                    assert!(
                        range.lower <= q
                            && q <= range.upper
                            && rate.abs() <= range.rate
                            && acceleration.abs() <= range.acceleration
                    );
                    let half = 0.5 * (range.upper - range.lower);
                    used = used.max((q - range.lower - half).abs() / half).max(rate.abs() / range.rate);
                    used = used.max(acceleration.abs() / range.acceleration);
                }
                assert!(used > 0.98, "{used}");
            }
        }
    }

    /// A joint that stands still shows less, and the criterion sees it.
    #[test]
    fn the_criterion_misses_no_joint() {
        let mut still = problem(ExcitedBase::Floating(Wrench::zero(), noise()));
        let all = still.design(50, 3).unwrap();
        still.ranges[1] = JointRange { lower: -1e-9, upper: 1e-9, rate: 1e-9, acceleration: 1e-9 };
        let one = still.design(50, 3);
        assert!(one.is_err() || one.unwrap().condition_number > 100.0 * all.condition_number);
    }

    #[test]
    fn what_leaves_no_room_is_refused() {
        let good = problem(ExcitedBase::Floating(Wrench::zero(), noise()));
        let refused = |change: &dyn Fn(&mut JointExcitation)| {
            let mut problem = good.clone();
            change(&mut problem);
            problem.design(1, 1).unwrap_err()
        };
        assert!(matches!(refused(&|p| p.period_s = f64::NAN), IdentificationError::InvalidPeriod { .. }));
        assert_eq!(refused(&|p| p.harmonics = 0), IdentificationError::NoHarmonics);
        assert!(matches!(refused(&|p| p.ranges[1].rate = 0.0), IdentificationError::NotPositive { index: 1, .. }));
        assert!(matches!(refused(&|p| p.ranges.truncate(1)), IdentificationError::Dynamics(_)));
    }
}
