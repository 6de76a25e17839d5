//! The dedicated solver against Clarabel's semidefinite cone, on random problems and on problem 4 `hard`.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use tumble_identification::laws::check_constrained_solver;
use tumble_identification::{
    BodyScale, ClarabelSdp, ConstrainedLeastSquares, FeasibleSet, InteriorPoint, Observability, PseudoInertiaCone,
    SquareRootInformation,
};

#[path = "suite/lapack_symbols.rs"]
mod lapack_symbols;
#[path = "suite/golden/problem4_hard.rs"]
mod problem4_hard;
#[path = "suite/random.rs"]
mod random;

use random::Random;

type Parameters = SVector<f64, 10>;

fn normals(random: &mut Random, sigma: [f64; 3]) -> Vector3<f64> {
    random.normals::<3>().component_mul(&Vector3::from(sigma))
}

/// Newton-Euler regressor (4.8), rows [torque; force].
fn regressor(w: Vector3<f64>, wdot: Vector3<f64>, a: Vector3<f64>) -> SMatrix<f64, 6, 10> {
    let g = |w: Vector3<f64>| {
        SMatrix::<f64, 3, 6>::new(
            w.x, w.y, w.z, 0.0, 0.0, 0.0, 0.0, w.x, 0.0, w.y, w.z, 0.0, 0.0, 0.0, w.x, 0.0, w.y, w.z,
        )
    };
    let (sw, sdot) = (w.cross_matrix(), wdot.cross_matrix());
    let mut y = SMatrix::<f64, 6, 10>::zeros();
    y.fixed_view_mut::<3, 3>(0, 1).copy_from(&-a.cross_matrix());
    y.fixed_view_mut::<3, 6>(0, 4).copy_from(&(g(wdot) + sw * g(w)));
    y.fixed_view_mut::<3, 1>(3, 0).copy_from(&a);
    y.fixed_view_mut::<3, 3>(3, 1).copy_from(&(sdot + sw * sw));
    y
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    WellExcited,
    ShortAndNoisy,
    Planar,
    NearDegenerateBody,
}

/// A free-flyer of 9.6 kg that may have grasped up to 8 kg, measured as `kind` says, with a weak prior.
fn problem(random: &mut Random, kind: Kind) -> SquareRootInformation<10> {
    let mass = 9.58 + 8.0 * random.share();
    let center = normals(random, [0.05; 3]);
    let spread = Matrix3::from_fn(|_, _| 0.1 * random.normal());
    let thickness = match kind {
        // Plates and rods: one or two of the three second moments all but vanish.
        Kind::NearDegenerateBody => [1.0, if random.share() < 0.5 { 1.0 } else { 1e-4 }, 1e-4],
        _ => [1.0; 3],
    };
    let spread = spread * Matrix3::from_diagonal(&Vector3::from(thickness)) * spread.transpose() * mass * 0.3;
    let solid = if kind == Kind::NearDegenerateBody { 1e-5 } else { 0.01 };
    let second_moments = spread + Matrix3::identity() * solid + center * center.transpose() * mass;
    let mut pseudo_inertia = second_moments.to_homogeneous();
    pseudo_inertia.fixed_view_mut::<3, 1>(0, 3).copy_from(&(center * mass));
    pseudo_inertia.fixed_view_mut::<1, 3>(3, 0).copy_from(&(center * mass).transpose());
    pseudo_inertia[(3, 3)] = mass;
    let truth = PseudoInertiaCone::parameters(&pseudo_inertia);

    let (samples, noise, rotation, translation) = match kind {
        Kind::WellExcited => (150, 0.005, [0.2; 3], [0.05; 3]),
        Kind::ShortAndNoisy | Kind::NearDegenerateBody => (30, 0.06, [0.2; 3], [0.05; 3]),
        Kind::Planar => (80, 0.01, [1e-8, 1e-8, 0.2], [0.05, 0.05, 1e-8]),
    };
    let sigma = SVector::from([noise, noise, noise, 4.0 * noise, 4.0 * noise, 4.0 * noise]);
    let mut information = SquareRootInformation::new();
    for _ in 0..samples {
        let block = regressor(normals(random, rotation), normals(random, rotation), normals(random, translation));
        let wrench = block * truth + sigma.map(|s| s * random.normal());
        let whitened = SMatrix::from_fn(|i, j| block[(i, j)] / sigma[i]);
        information.update(&whitened, &wrench.component_div(&sigma)).unwrap();
    }
    information.add_prior(&nominal(), &SVector::from([3.0, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5])).unwrap();
    information
}

fn nominal() -> Parameters {
    SVector::from([9.58, 0.0, 0.0, 0.0, 0.15, 0.0, 0.0, 0.15, 0.0, 0.15])
}

/// The definition: positive mass and principal inertias about the centre of mass that obey the triangle inequalities.
fn is_a_body(p: &Parameters) -> bool {
    let center = Vector3::new(p[1], p[2], p[3]) / p[0];
    let about_origin = Matrix3::new(p[4], p[5], p[6], p[5], p[7], p[8], p[6], p[8], p[9]);
    let shift = (Matrix3::identity() * center.norm_squared() - center * center.transpose()) * p[0];
    let principal = (about_origin - shift).symmetric_eigenvalues();
    p[0] > 0.0 && principal.min() > 0.0 && principal.sum() > 2.0 * principal.max()
}

#[test]
fn ten_thousand_random_problems() {
    let cone = PseudoInertiaCone::with_absolute_floor(BodyScale::of(&nominal()).unwrap(), 1e-6);
    let (ours, clarabel) = (InteriorPoint::new(cone), ClarabelSdp::new(cone, 1e-11));
    let kinds = [Kind::WellExcited, Kind::ShortAndNoisy, Kind::Planar, Kind::NearDegenerateBody];
    for (seed, kind) in kinds.into_iter().enumerate() {
        let mut random = Random::new(20 + seed as u64);
        let (mut active, mut compared, mut iterations) = (0, 0, 0);
        let (mut worst_excess, mut worst_gap, mut worst_distance) = (f64::MIN, 0.0_f64, 0.0_f64);
        for case in 0..2600 {
            let information = problem(&mut random, kind);
            let a = ours.solve(&information).unwrap_or_else(|e| panic!("{kind:?} {case}: {e}"));
            let b = clarabel.solve(&information).unwrap_or_else(|e| panic!("{kind:?} {case}, Clarabel: {e}"));
            let label = format!("{kind:?} {case}\nours {a:?}\nClarabel {b:?}");

            assert!(a.margin > 0.0 && cone.margin(&a.parameters) > 0.0 && is_a_body(&a.parameters), "{label}");
            assert!(a.duality_gap <= 1e-6, "{label}");
            assert!(a.objective - b.objective <= (1e-8 * b.objective).max(1e-6), "{label}");
            let distance = (information.residual(&a.parameters) - information.residual(&b.parameters)).norm();
            assert!(distance <= 3e-3, "{distance:e} {label}");
            let condition = Observability::new(&information, cone.scale()).condition_number();
            if !a.is_active() && condition <= 1e3 {
                // Half a chi-square of 1e-9 moves a barely known parameter by more than 1e-6; Clarabel may need to be
                // asked for more than it ordinarily reaches.
                let difference = [1e-11, 1e-12, 1e-13]
                    .into_iter()
                    .filter_map(|tolerance| ClarabelSdp::new(cone, tolerance).solve(&information).ok())
                    .map(|b| (a.parameters - b.parameters).amax() / a.parameters.amax())
                    .find(|&difference| difference <= 1e-6);
                assert!(difference.is_some(), "{label}");
                compared += 1;
            }
            active += usize::from(a.is_active());
            iterations = iterations.max(a.iterations);
            worst_excess = worst_excess.max(a.objective - b.objective);
            worst_gap = worst_gap.max(a.duality_gap);
            worst_distance = worst_distance.max(distance);
        }
        println!(
            "{kind:?}: {active}/2600 bind, {compared} inactive and compared, at most {iterations} iterations, excess {worst_excess:.1e}, \
             gap {worst_gap:.1e}, |R Δp| {worst_distance:.1e}"
        );
        match kind {
            Kind::WellExcited => assert!(active < 260),
            _ => assert!(active > 1300),
        }
    }
}

#[test]
fn problem4_hard_agrees_in_both_forms() {
    let cone = problem4_hard::cone();
    let (mut ours, mut quadratic, mut epigraph) = (0.0, 0.0, 0.0);
    for problem in problem4_hard::problems() {
        ours += 2.0 * InteriorPoint::new(cone).solve(&problem).unwrap().objective;
        quadratic += 2.0 * ClarabelSdp::new(cone, 1e-11).solve(&problem).unwrap().objective;
        epigraph += 2.0 * ClarabelSdp::epigraph(cone, 1e-9).solve(&problem).unwrap().objective;
    }
    println!("ours {ours}, Clarabel {quadratic}, epigraph form {epigraph}");
    for sum in [ours, quadratic, epigraph] {
        assert!((sum - 143.336).abs() < 0.01, "{sum}");
    }
    assert!(ours - quadratic < 49e-6);
}

#[test]
fn clarabel_holds_the_solver_laws() {
    let cone = PseudoInertiaCone::with_absolute_floor(BodyScale::of(&nominal()).unwrap(), 1e-6);
    let mut random = Random::new(9);
    let problems: Vec<_> = (0..10).map(|_| problem(&mut random, Kind::ShortAndNoisy)).collect();
    check_constrained_solver(&ClarabelSdp::new(cone, 1e-12), &cone, &problems, 1e-5).unwrap();
}
