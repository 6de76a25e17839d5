//! Invariant sets against known numbers, against sums of their definition, and against each other.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_identification::noise::{between, signed_unit};
use tumble_planning::PlanningError;
use tumble_planning::control::{
    AxisGain, AxisTemplate, ConvexSet, MinimalInvariantSet, MinkowskiSum, Polygon, RakovicSet, SymmetricBox,
    SymmetricEllipsoid, Zonotope, discrete_lqr,
};
use tumble_planning::laws::{check_invariant_set, check_supports};
use tumble_planning::nalgebra::{
    Matrix1, Matrix2, Matrix2x3, Matrix3, Matrix6, Matrix6x3, RowVector2, SMatrix, SVector, Vector2, Vector6,
};

fn close(found: f64, expected: f64, error: f64) {
    assert!((found - expected).abs() <= error, "{found} {expected}");
}

/// The example of Rakovic et al. 2005: closed loop and feedback.
fn example() -> (Matrix2<f64>, Vector2<f64>) {
    let gain = -Vector2::new(1.17, 1.03);
    (Matrix2::new(1.0, 1.0, 0.0, 1.0) + Vector2::new(1.0, 1.0) * gain.transpose(), gain)
}

const UNIT_BOX: SymmetricBox<2> = SymmetricBox(Vector2::new(1.0, 1.0));

#[test]
fn exact_supports_of_the_example() {
    let (closed_loop, gain) = example();
    let set = MinimalInvariantSet::try_new(closed_loop, UNIT_BOX).unwrap();
    let expected = [(Vector2::x(), 100.0 / 77.0), (Vector2::y(), 200.0 / 77.0), (gain, 4.194_805_195)];
    for (direction, expected) in expected {
        let support = set.support(&direction, 1e-12);
        close(support.upper, expected, 1e-9);
        close(support.lower, expected, 1e-9);
        assert_eq!(support.terms, 24);
    }
    let together = set.supports(&Matrix2x3::from_columns(&[Vector2::x(), Vector2::y(), gain]), 1e-12);
    assert!(expected.iter().zip(&together).all(|((_, expected), found)| (expected - found).abs() < 1e-9));
}

#[test]
fn four_approximations_of_the_example() {
    let (closed_loop, _) = example();
    let normals = [Vector2::x(), Vector2::y()];
    for (epsilon, terms, alpha, vertices, area) in [
        (0.19, 4, 0.0261, 16, 12.3751),
        (0.05, 5, 0.00792, 20, 12.0714),
        (0.01, 6, 0.00237, 24, 11.9808),
        (5e-5, 10, 1.92e-5, 40, 11.9430),
    ] {
        let set = RakovicSet::try_new(closed_loop, UNIT_BOX.zonotope(), &normals, epsilon).unwrap();
        assert_eq!(set.terms(), terms);
        close(set.alpha() / alpha, 1.0, 2e-3);
        let polygon = Polygon::of_generators(set.generators());
        assert_eq!(polygon.vertices().len(), vertices);
        close(polygon.area(), area, 5.1e-5);
        close(polygon.invariance_ratio(&closed_loop, &UNIT_BOX), 1.0, 1e-9);
        check_invariant_set(&closed_loop, &UNIT_BOX, &set, &polygon.normals(), 1, 100, 1e-9).unwrap();
        check_invariant_set(&closed_loop, &UNIT_BOX, &polygon, &polygon.normals(), 1, 100, 1e-9).unwrap();
        // one term fewer is not near enough, and it is above the smallest set by at most what was asked for
        let fewer = RakovicSet::with_terms(closed_loop, UNIT_BOX, &normals, terms - 1).unwrap();
        let smallest = MinimalInvariantSet::try_new(closed_loop, UNIT_BOX).unwrap();
        let excess = |set: &dyn Fn(&Vector2<f64>) -> f64| {
            normals.iter().map(|normal| set(normal) - ConvexSet::support(&smallest, normal)).fold(0.0, f64::max)
        };
        assert!(excess(&|d| set.support(d)) <= epsilon && excess(&|d| set.support(d)) < excess(&|d| fewer.support(d)));
    }
    let flat = SymmetricBox(Vector2::new(1.0, 0.0));
    assert!(matches!(RakovicSet::try_new(closed_loop, flat, &normals, 0.1), Err(PlanningError::OutOfRange { .. })));
}

/// Three decoupled axes of the frozen ninth problem: closed loop, feedback.
fn ninth() -> (Matrix6<f64>, SMatrix<f64, 3, 6>) {
    let (mass_kg, step_s) = (9.5838, 0.2);
    let mut a = Matrix6::identity();
    a.fixed_view_mut::<3, 3>(0, 3).copy_from(&(Matrix3::identity() * step_s));
    let mut b = Matrix6x3::zeros();
    b.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() * (0.5 * step_s * step_s / mass_kg)));
    b.fixed_view_mut::<3, 3>(3, 0).copy_from(&(Matrix3::identity() * (step_s / mass_kg)));
    let weight = Matrix6::from_diagonal(&Vector6::new(10.0, 10.0, 10.0, 1.0, 1.0, 1.0));
    let (gain, _) = discrete_lqr(&a, &b, &weight, &Matrix3::identity()).unwrap();
    (a + b * gain, gain)
}

#[test]
fn supports_of_the_ninth_problem_coupled_and_by_axis() {
    let (closed_loop, gain) = ninth();
    let widths = Vector6::new(5e-4, 5e-4, 5e-4, 1e-3, 1e-3, 1e-3);
    let set = MinimalInvariantSet::try_new(closed_loop, SymmetricBox(widths)).unwrap();
    close(set.contraction().rate(), 0.9398, 5e-5);
    let mut directions = SMatrix::<f64, 6, 9>::zeros();
    directions.fixed_view_mut::<6, 6>(0, 0).fill_with_identity();
    directions.fixed_view_mut::<6, 3>(0, 6).copy_from(&gain.transpose());
    let expected = [0.023_735_583_4, 0.011_476_488_7, 0.081_575_788_8];
    let together = set.supports(&directions, 1e-12);
    for column in 0..9 {
        close(together[column], expected[column / 3], 1e-10);
        // a block of eight terms is all or nothing
        let coarse = set.support(&directions.column(column).into(), 1e-6);
        assert!((182..=192).contains(&coarse.terms) && coarse.upper - coarse.lower <= 1e-6 * coarse.lower);
        assert!((352..=360).contains(&set.support(&directions.column(column).into(), 1e-12).terms));
    }
    let rakovic = RakovicSet::try_new(closed_loop, SymmetricBox(widths), &basis(), 1e-3).unwrap();
    assert_eq!(rakovic.terms(), 39);
    close(rakovic.alpha(), 0.0413, 5e-5);

    let axis = Matrix2::new(closed_loop[(0, 0)], closed_loop[(0, 3)], closed_loop[(3, 0)], closed_loop[(3, 3)]);
    let narrow = Vector2::new(5e-4, 1e-3);
    let directions = [Vector2::x(), Vector2::y(), Vector2::new(gain[(0, 0)], gain[(0, 3)])];
    let ellipsoid = SymmetricEllipsoid(Matrix2::from_diagonal(&narrow.component_mul(&narrow)));
    let by_box = MinimalInvariantSet::try_new(axis, SymmetricBox(narrow)).unwrap();
    let by_ellipsoid = MinimalInvariantSet::try_new(axis, ellipsoid).unwrap();
    let blown_up = [0.023_741_9, 0.011_480_1, 0.081_602_7];
    let round = [0.018_896_3, 0.009_608_3, 0.071_135_3];
    for row in 0..3 {
        close(by_box.support(&directions[row], 1e-12).upper, expected[row], 1e-10);
        close(by_ellipsoid.support(&directions[row], 1e-9).upper, round[row], 5.1e-8);
        let place = [0, 3];
        let mut wide = Vector6::zeros();
        (0..2).for_each(|i| wide[place[i]] = directions[row][i]);
        close(rakovic.support(&wide), blown_up[row], 5.1e-8);
    }
}

fn basis<const N: usize>() -> [SVector<f64, N>; N] {
    core::array::from_fn(|axis| SVector::from_fn(|i, _| if i == axis { 1.0 } else { 0.0 }))
}

/// Supports along feedback, position and velocity.
fn reach(closed_loop: Matrix2<f64>, disturbance: impl ConvexSet<2>, gain: &Vector2<f64>) -> [f64; 3] {
    let set = MinimalInvariantSet::try_new(closed_loop, disturbance).unwrap();
    [*gain, Vector2::x(), Vector2::y()].map(|direction| set.support(&direction, 1e-9).upper)
}

fn reach_of(gain: &AxisGain, disturbance: impl ConvexSet<2>) -> [f64; 3] {
    reach(gain.closed_loop(), disturbance, &gain.feedback())
}

#[test]
fn what_gains_make_of_disturbances() {
    for (stiffness, damping, g, position, velocity, of_position, of_velocity, share) in [
        (0.25, 2.0, 1.1017, 4.0, 0.90, 0.0011, 0.0054, 0.449),
        (0.5, 2.5, 1.1285, 2.0, 0.72, 0.0018, 0.0055, 0.436),
        (1.0, 4.0, 1.1113, 1.0, 0.47, 0.0024, 0.0053, 0.444),
        (0.25, 1.0, 1.2905, 4.0, 1.52, 0.0019, 0.0063, 0.355),
        (2.91367 / 9.5838, 7.52974 / 9.5838, 1.4665, 3.6, 1.79, 0.0027, 0.0072, 0.267),
    ] {
        let gain = AxisGain { stiffness, damping, step_s: 0.2 };
        let [input, of_input, at_speed] = reach_of(&gain, gain.matched_disturbance());
        close(input, g, 5.1e-5);
        close(of_input, position, 0.051);
        close(at_speed, velocity, 5.1e-3);
        close(reach_of(&gain, SymmetricBox(Vector2::new(1e-3, 0.0)))[0], of_position, 5.1e-5);
        close(reach_of(&gain, SymmetricBox(Vector2::new(0.0, 1e-3)))[0], of_velocity, 5.1e-5);
        close(1.0 - 0.5 * input, share, 5.1e-4);
    }
}

#[test]
fn what_is_left_of_the_input_where_the_mass_is_uncertain() {
    let gain = AxisGain::default();
    let [g, _, _] = reach_of(&gain, gain.matched_disturbance());
    for (r, by_default, permissive, by_mass, by_inverse, of_physical) in [
        (0.1, 0.824, 0.809, 0.878, 0.890, 0.989),
        (0.2, 0.604, 0.571, 0.725, 0.780, 0.975),
        (0.3, 0.321, 0.265, 0.528, 0.670, 0.956),
        (0.4, -0.056, -0.144, 0.266, 0.559, 0.932),
        (0.5, -0.584, -0.716, -0.102, 0.449, 0.898),
    ] {
        // the lightest body is accelerated by this share more than the one in the middle
        let more = 1.0 / (1.0 - r) - 1.0;
        for (weights, expected) in [([5.0, 10.0, 2.0], by_default), ([5.0, 2.0, 0.5], permissive)] {
            let (a, b) = (Matrix2::new(1.0, 1.0, 0.0, 1.0), Vector2::new(0.5, 1.0) / 9.58);
            let weight = Matrix2::from_diagonal(&Vector2::new(weights[0], weights[1]));
            let (feedback, _) = discrete_lqr(&a, &b, &weight, &Matrix1::new(weights[2])).unwrap();
            let feedback: RowVector2<f64> = feedback;
            let disturbance = SymmetricBox(b * (more * 0.15));
            let [force, _, _] = reach(a + b * feedback, disturbance, &feedback.transpose());
            close(1.0 - force / 0.15, expected, 5.1e-4);
        }
        close(1.0 - more * g, by_mass, 5.1e-4);
        // masses 1 - r to 1 + r are r about 1 - r^2
        close(1.0 - r * g, by_inverse, 5.1e-4);
        close((1.0 - r * g) / (1.0 - r), of_physical, 5.1e-4);
    }
}

struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// In -1..1.
    fn uniform(&mut self) -> f64 {
        signed_unit(&mut self.0)
    }

    fn between(&mut self, least: f64, largest: f64) -> f64 {
        between(&mut self.0, least, largest)
    }

    fn vector<const N: usize>(&mut self) -> SVector<f64, N> {
        SVector::from_fn(|_, _| self.uniform())
    }
}

/// One random closed loop, disturbances of all kinds, one direction.
fn check_random<const N: usize>(draws: &mut Draws, rounds: usize) {
    for round in 0..rounds {
        let mut closed_loop = SMatrix::<f64, N, N>::from_fn(|_, _| draws.uniform());
        // scaled by an estimate of the spectral radius that is independent of the library's
        let mut power = closed_loop;
        let mut growth = 1.0;
        for _ in 0..60 {
            growth = power.norm();
            power = closed_loop * (power / growth);
        }
        closed_loop *= draws.between(0.1, 0.95) / growth;
        let a_box = SymmetricBox(draws.vector::<N>().abs());
        let zonotope = Zonotope(SMatrix::<f64, N, 4>::from_fn(|_, _| draws.uniform()));
        let half = SMatrix::<f64, N, N>::from_fn(|_, _| draws.uniform());
        let ellipsoid = SymmetricEllipsoid(half * half.transpose());
        let direction = draws.vector::<N>();
        let tolerance = [1e-3, 1e-6, 1e-9][round / 4 % 3];
        match round % 4 {
            0 => check_one(&closed_loop, a_box, &direction, tolerance),
            1 => check_one(&closed_loop, zonotope, &direction, tolerance),
            2 => check_one(&closed_loop, ellipsoid, &direction, tolerance),
            _ => check_one(&closed_loop, MinkowskiSum(a_box, ellipsoid), &direction, tolerance),
        }
    }
}

fn check_one<const N: usize>(
    closed_loop: &SMatrix<f64, N, N>,
    disturbance: impl ConvexSet<N> + Clone,
    direction: &SVector<f64, N>,
    tolerance: f64,
) {
    // the scale is that of an estimate
    let Ok(set) = MinimalInvariantSet::try_new(*closed_loop, disturbance.clone()) else {
        let norm = (0..200).fold(SMatrix::<f64, N, N>::identity(), |power, _| power * closed_loop).norm();
        assert!(norm > 1e-2, "{norm}");
        return;
    };
    check_supports(closed_loop, &disturbance, &|d, t| set.support(d, t), &[*direction], tolerance).unwrap();
}

#[test]
fn ten_thousand_random_supports() {
    let mut draws = Draws::new(8);
    check_random::<2>(&mut draws, 5000);
    check_random::<3>(&mut draws, 3000);
    check_random::<6>(&mut draws, 2000);
}

#[test]
fn no_stabilising_gain_answers_a_matched_disturbance_with_less_than_it() {
    let mut draws = Draws::new(9);
    let (mut stable, mut least) = (0, f64::INFINITY);
    while stable < 2000 {
        let gain = AxisGain {
            stiffness: libm::exp(draws.between(-5.0, 4.0)),
            damping: libm::exp(draws.between(-4.0, 3.0)),
            step_s: draws.between(0.05, 1.0),
        };
        let Ok(set) = MinimalInvariantSet::try_new(gain.closed_loop(), gain.matched_disturbance()) else { continue };
        stable += 1;
        let g = set.support(&gain.feedback(), 1e-6).lower;
        assert!(g >= 1.0 - 1e-6, "{gain:?} {g}");
        least = least.min(g);
        if let Ok(template) = AxisTemplate::try_new(gain, &SymmetricBox(Vector2::zeros())) {
            assert!(template.matched_input() >= g * (1.0 - 1e-9), "{gain:?} {template:?}");
        }
    }
    assert!(least < 1.01, "{least}");
}

#[test]
fn what_does_not_reach_a_direction_ends_and_is_bounded() {
    // two axes that do not know of each other, one undisturbed
    let closed_loop = Matrix2::new(0.9, 0.0, 0.0, 0.8);
    let set = MinimalInvariantSet::try_new(closed_loop, SymmetricBox(Vector2::new(1.0, 0.0))).unwrap();
    let blind = set.support(&Vector2::y(), 1e-9);
    assert!(blind.lower.abs() <= 0.0 && blind.upper < 1e-18 && blind.terms < 1000, "{blind:?}");
    close(set.support(&Vector2::x(), 1e-12).upper, 10.0, 1e-10);
    // nothing at all, no direction, no number
    let still = MinimalInvariantSet::try_new(closed_loop, SymmetricBox(Vector2::zeros())).unwrap();
    assert_eq!(still.support(&Vector2::x(), 1e-9).terms, 0);
    assert!(set.support(&Vector2::zeros(), 1e-9).upper.abs() <= 0.0);
    assert!(set.support(&Vector2::new(0.0, f64::NAN), 1e-9).upper.is_nan());
    assert!(set.support(&Vector2::new(f64::INFINITY, 0.0), 1e-9).upper.is_nan());
    // as asked for as a sum can be
    let finest = set.support(&Vector2::x(), f64::NAN);
    assert!(finest.upper - finest.lower <= 2e-15 * 10.0);
    // scaled far up and down
    close(set.support(&Vector2::new(1e-200, 0.0), 1e-12).upper / 1e-200, 10.0, 1e-10);
    close(set.support(&Vector2::new(1e200, 0.0), 1e-12).upper / 1e200, 10.0, 1e-10);
    // too slow for a million terms: cut off, and still on both sides
    let slow = MinimalInvariantSet::try_new(Matrix2::new(1.0 - 1e-7, 0.0, 0.0, 0.5), UNIT_BOX).unwrap();
    let cut = slow.support(&Vector2::x(), 1e-6);
    assert!(cut.lower < 1e7 && 1e7 < cut.upper && cut.terms == 1 << 20, "{cut:?}");
    let endless = SymmetricBox(Vector2::new(f64::INFINITY, 1.0));
    assert!(matches!(MinimalInvariantSet::try_new(closed_loop, endless), Err(PlanningError::NotFinite { .. })));
    let outcome = MinimalInvariantSet::try_new(Matrix2::new(1.0, 0.2, 0.0, 1.0), UNIT_BOX);
    assert!(matches!(outcome, Err(PlanningError::NotContractive { .. })));
}
