//! Each law catches its defect: a table of broken groups, and the laws that must (and alone may) break for each.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::cast_possible_truncation)]

use core::cell::Cell;
use core::ops::Mul;
use std::collections::BTreeSet;
use tumble_lie::laws::{self, for_all};
use tumble_lie::nalgebra::{Isometry3, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6};
use tumble_lie::num_dual::Dual64;
use tumble_lie::strategies::{points, poses, tangents, twists, wrenches};
use tumble_lie::{GroupAction, LieGroup, Pose, Scalar, Twist, Wrench, real, rotation_jacobian_inverse, value};

#[derive(Clone, Copy, PartialEq)]
enum Defect {
    None,
    /// Products whose quaternion grows by 1e-12 each: no single product shows it.
    ProductNotNormalised,
    /// Single precision far from the identity.
    LogInSinglePrecision,
    /// Returns the right value at zero, without the derivative it has there.
    ExpWithoutSmallAngleSeries,
    LogOnTheOtherCover,
    /// The adjoint of the inverse, with the coadjoint that goes with it.
    AdjointTransposed,
    /// Momenta moved as velocities.
    CoadjointIsAdjoint,
    BracketSign,
    LeftForRightJacobian,
    /// Translates before it rotates.
    ActionOrder,
    /// Another representation of the group, which stretches.
    ActionStretches,
    /// Blends logarithms instead of following the geodesic.
    InterpolationBlendsLogs,
}

thread_local! {
    /// The defect of [`Broken`]; each test runs in its own thread.
    static DEFECT: Cell<Defect> = const { Cell::new(Defect::None) };
}

fn has(defect: Defect) -> bool {
    DEFECT.get() == defect
}

#[derive(Clone, Copy, Debug)]
struct Broken<T: Scalar>(Pose<T>);

impl<T: Scalar> Mul for Broken<T> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        let mut product = self.0 * other.0;
        if has(Defect::ProductNotNormalised) {
            let grown = product.rotation.into_inner() * real::<T>(1.0 + 1e-12);
            product.rotation = UnitQuaternion::new_unchecked(grown);
        }
        Self(product)
    }
}

impl<T: Scalar> LieGroup for Broken<T> {
    type Scalar = T;
    type Tangent = Vector6<T>;
    type Jacobian = Matrix6<T>;
    fn identity() -> Self {
        Self(Pose::identity())
    }
    fn inverse(&self) -> Self {
        Self(self.0.inverse())
    }
    fn exp(xi: &Vector6<T>) -> Self {
        if has(Defect::ExpWithoutSmallAngleSeries) {
            let angle = xi.fixed_rows::<3>(0).norm_squared();
            if angle == T::zero() {
                return Self(Pose::from_parts(xi.fixed_rows::<3>(3).into_owned().into(), UnitQuaternion::identity()));
            }
        }
        Self(<Pose<T> as LieGroup>::exp(xi))
    }
    fn log(&self) -> Vector6<T> {
        let xi = self.0.log();
        if has(Defect::LogInSinglePrecision) && xi.norm() > real(1.5) {
            return xi.map(|x| x + real(f64::from(value(x) as f32) - value(x)));
        }
        if has(Defect::LogOnTheOtherCover) && self.0.rotation.w < T::zero() {
            let phi = LieGroup::log(&self.0.rotation);
            let long = phi - phi.normalize() * T::two_pi();
            let rho = rotation_jacobian_inverse(&-long) * self.0.translation.vector;
            return Twist::new(long, rho).to_vector();
        }
        xi
    }
    fn adjoint(&self) -> Matrix6<T> {
        if has(Defect::AdjointTransposed) { self.0.inverse().adjoint() } else { self.0.adjoint() }
    }
    fn coadjoint(&self) -> Matrix6<T> {
        if has(Defect::AdjointTransposed) {
            self.0.inverse().coadjoint()
        } else if has(Defect::CoadjointIsAdjoint) {
            self.0.adjoint()
        } else {
            self.0.coadjoint()
        }
    }
    fn bracket(a: &Vector6<T>, b: &Vector6<T>) -> Vector6<T> {
        let bracket = Pose::bracket(a, b);
        if has(Defect::BracketSign) { -bracket } else { bracket }
    }
    fn right_jacobian(xi: &Vector6<T>) -> Matrix6<T> {
        if has(Defect::LeftForRightJacobian) { Pose::left_jacobian(xi) } else { Pose::right_jacobian(xi) }
    }
    fn right_jacobian_inverse(xi: &Vector6<T>) -> Matrix6<T> {
        if has(Defect::LeftForRightJacobian) {
            Pose::left_jacobian_inverse(xi)
        } else {
            Pose::right_jacobian_inverse(xi)
        }
    }
    fn interpolate(&self, other: &Self, fraction: T) -> Self {
        if has(Defect::InterpolationBlendsLogs) {
            let blend = self.0.log() * (T::one() - fraction) + other.0.log() * fraction;
            return Self(<Pose<T> as LieGroup>::exp(&blend));
        }
        Self(self.0.interpolate(&other.0, fraction))
    }
}

impl<T: Scalar> GroupAction<Vector3<T>> for Broken<T> {
    fn act(&self, point: &Vector3<T>) -> Vector3<T> {
        let stretch = Vector3::new(T::one(), real(2.0), T::one());
        if has(Defect::ActionOrder) {
            self.0.rotation.act(&(point + self.0.translation.vector))
        } else if has(Defect::ActionStretches) {
            self.0.act(&point.component_mul(&stretch)).component_div(&stretch)
        } else {
            self.0.act(point)
        }
    }
}

/// Names of the laws the group breaks.
fn broken_laws(defect: Defect) -> BTreeSet<&'static str> {
    type Group = Broken<f64>;
    const TOLERANCE: f64 = 1e-9;
    DEFECT.set(defect);
    let xi = tangents::<Vector6<f64>>(3);
    let exp = |xi: &Vector6<f64>| <Group as LieGroup>::exp(xi);
    let three = (xi.clone(), xi.clone(), xi.clone());
    let verdicts = [
        (
            "group_axioms",
            for_all(&three, |(a, b, c)| laws::check_group_axioms(&[exp(&a), exp(&b), exp(&c)], TOLERANCE)),
        ),
        ("exp_log", for_all(&xi, |xi| laws::check_exp_log::<Group>(&[xi], TOLERANCE))),
        ("regimes", for_all(&xi, |xi| laws::check_regimes::<Group, Broken<Dual64>>(&[xi], TOLERANCE))),
        (
            "double_cover",
            for_all(&poses(), |pose| {
                let negative = UnitQuaternion::new_unchecked(-pose.rotation.into_inner());
                let other = Pose::from_parts(pose.translation, negative);
                laws::check_double_cover(&[(Broken(pose), Broken(other))], TOLERANCE)
            }),
        ),
        ("adjoint", for_all(&three, |(a, b, c)| laws::check_adjoint(&[exp(&a), exp(&b)], &[c], TOLERANCE))),
        ("coadjoint", for_all(&three, |(a, b, c)| laws::check_coadjoint(&[exp(&a)], &[b, c], TOLERANCE))),
        ("bracket", for_all(&three, |(a, b, c)| laws::check_bracket::<Group>(&[a, b, c], TOLERANCE))),
        ("right_jacobian", for_all(&xi, |xi| laws::check_right_jacobian::<Group>(&[xi], TOLERANCE))),
        (
            "action",
            for_all(&(xi.clone(), xi.clone(), points::<3>()), |(a, b, p)| {
                laws::check_action(&[exp(&a), exp(&b)], &[p], TOLERANCE)
            }),
        ),
        (
            "isometric_action",
            for_all(&(xi.clone(), points::<3>(), points::<3>()), |(a, p, q)| {
                laws::check_isometric_action(&[exp(&a)], &[p, q], TOLERANCE)
            }),
        ),
        ("interpolation", for_all(&three, |(a, b, c)| laws::check_interpolation(&exp(&a), &b, &exp(&c), TOLERANCE))),
    ];
    let broken = verdicts.into_iter().filter_map(|(law, verdict)| verdict.err().map(|message| (law, message)));
    broken
        .map(|(law, message)| {
            assert!(message.contains(&format!("law '{law}/")), "{law} reports another law: {message}");
            law
        })
        .collect()
}

macro_rules! defects {
    ($($test:ident: $defect:ident breaks [$($law:literal),*];)*) => {
        $(
            #[test]
            fn $test() {
                assert_eq!(broken_laws(Defect::$defect), BTreeSet::from([$($law),*]));
            }
        )*
    };
}

defects! {
    sound_group: None breaks [];
    product_not_normalised: ProductNotNormalised breaks ["group_axioms"];
    log_in_single_precision: LogInSinglePrecision breaks ["exp_log"];
    exp_without_small_angle_series: ExpWithoutSmallAngleSeries breaks ["regimes"];
    log_on_the_other_cover: LogOnTheOtherCover breaks ["double_cover"];
    adjoint_transposed: AdjointTransposed breaks ["adjoint"];
    coadjoint_is_adjoint: CoadjointIsAdjoint breaks ["coadjoint"];
    bracket_sign: BracketSign breaks ["bracket"];
    left_for_right_jacobian: LeftForRightJacobian breaks ["right_jacobian"];
    action_order: ActionOrder breaks ["action"];
    action_stretches: ActionStretches breaks ["isometric_action"];
    interpolation_blends_logs: InterpolationBlendsLogs breaks ["interpolation"];
}

/// Changing the frame of a wrench without the moment of its force.
#[test]
fn wrench_without_moment_breaks_power_pairing() {
    let outcome = for_all(&(poses(), twists(), wrenches()), |(pose, twist, wrench)| {
        let forget_moment =
            |wrench: &Wrench<f64>| Wrench::new(pose.rotation * wrench.torque, pose.rotation * wrench.force);
        laws::check_power_pairing(&twist, &wrench, |twist| twist.transformed_by(&pose), forget_moment, 1e-12)
    });
    assert!(outcome.unwrap_err().contains("law 'power_pairing/invariance'"));
}

/// A NaN is a violation, not a pass.
#[test]
fn not_a_number_breaks_laws() {
    let nan = Isometry3::from_parts(
        Vector3::repeat(f64::NAN).into(),
        UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, 0.0, 0.0, 0.0)),
    );
    assert!(laws::check_group_axioms(&[nan], 1.0).is_err());
    assert!(laws::check_exp_log::<Pose<f64>>(&[Vector6::repeat(f64::NAN)], 1.0).is_err());
}

/// Whatever the inputs, a message is three lines that fit on a screen: every law of every crate speaks through this type.
#[test]
fn messages_are_three_lines() {
    let long = |text: &str| {
        laws::require("a law", &text.repeat(500), &[1.0 / 3.0; 400], &text, 1.0 / 3.0, 1e-300).unwrap_err()
    };
    for text in ["word ", "1.234,", "line\n\n", "größe\t", "", "\u{2028}"] {
        let mut broken = long(text);
        for part in
            [text.repeat(500), format!("{text} {}", "x".repeat(500)), Matrix6::<f64>::repeat(1.0 / 3.0).to_string()]
        {
            (broken.inputs, broken.expected, broken.found) = (part.clone(), part.clone(), part);
            let message = broken.to_string();
            assert!(
                message.lines().count() == 3 && message.lines().all(|line| line.chars().count() <= 170),
                "{message}"
            );
        }
        assert!(long(text).to_string().lines().count() == 3);
    }
    let values = &proptest::prelude::Just([0.1_f64; 300]);
    let broken = for_all(values, |value| laws::require("a law", &value, &0, &value, 1.0, 0.0)).unwrap_err();
    assert!(broken.lines().count() == 3 && broken.lines().all(|line| line.chars().count() <= 300), "{broken}");
}
