//! Bodies that exist stay bodies, and only those: 1e5 random bodies, most of them near or on the boundary.

use proptest::prelude::*;
use tumble_dynamics::laws::inertia::triangle_margin;
use tumble_dynamics::laws::{InertiaOperations, InertiaSamples, check_inertia};
use tumble_dynamics::lie::Pose;
use tumble_dynamics::nalgebra::{SVector, Vector3};
use tumble_dynamics::strategies::{
    bodies, boundary_bodies, clouds, draws, impossible_bodies, judged_bodies, near_boundary_bodies, poses,
};
use tumble_dynamics::{InertialParameters, LogCholesky, ParameterOrder, from_pseudo_inertia, pseudo_inertia};

type Body = InertialParameters<f64>;

/// Mass, length and time in other units: kg -> `10^-mass`, m -> `10^-length` (time does not enter inertia).
fn in_other_units(body: &Body, mass_decades: i32, length_decades: i32) -> Body {
    let (mass, length) = (10f64.powi(mass_decades), 10f64.powi(length_decades));
    InertialParameters {
        mass: body.mass * mass,
        first_moment: body.first_moment * mass * length,
        inertia_about_origin: body.inertia_about_origin * mass * length * length,
    }
}

#[test]
fn the_verdict_is_the_definition_on_1e5_random_bodies() {
    let sample = draws(&judged_bodies(), 1, 100_000);
    let near = sample.iter().filter(|body| body.margin.abs() < 0.01).count();
    assert!(near >= 20_000, "{near} of {} within one per cent of the boundary", sample.len());
    let (mut inside, mut outside, mut on) = (0, 0, 0);
    for body in &sample {
        let found = body.parameters.consistency_margin();
        let by_definition = triangle_margin(&body.parameters).unwrap();
        assert!((found - body.margin).abs() < 1e-10 || body.margin == 0.0, "{found:e}: {body:?}");
        let verdicts = (body.parameters.is_consistent(), body.parameters.is_strictly_consistent());
        if body.margin == 0.0 {
            on += 1;
            assert_eq!(verdicts, (true, false), "{body:?}, margin {found:e}");
        } else {
            assert!(body.margin.abs() > 1e-9);
            *(if body.margin > 0.0 { &mut inside } else { &mut outside }) += 1;
            let exists = body.margin > 0.0;
            assert_eq!(verdicts, (exists, exists), "{body:?}, margin {found:e}");
            assert_eq!(by_definition > 0.0, exists, "{body:?}, triangles {by_definition:e}");
        }
    }
    assert!(inside > 20_000 && outside > 20_000 && on > 10_000, "{inside} {outside} {on}");
}

#[test]
fn the_verdict_does_not_depend_on_units_or_on_the_origin() {
    for body in draws(&judged_bodies(), 2, 2_000) {
        for (mass, length) in [(-9, 0), (9, 0), (0, -9), (0, 9), (-9, 9), (6, -3)] {
            let other = in_other_units(&body.parameters, mass, length);
            assert_eq!(other.is_consistent(), body.margin >= 0.0, "{body:?} in {mass}, {length}");
            assert_eq!(other.is_strictly_consistent(), body.margin > 0.0, "{body:?} in {mass}, {length}");
            assert!((other.consistency_margin() - body.parameters.consistency_margin()).abs() < 1e-10);
        }
    }
    // a thousand radii from the origin the ten numbers resolve the margin to about 1e-9
    for body in draws(&judged_bodies(), 3, 2_000) {
        let radius = (body.parameters.inertia_about_com().amax() / body.parameters.mass).sqrt();
        let far = body.parameters.transformed_by(&Pose::translation(1e3 * radius, -2e2 * radius, 5e2 * radius));
        if body.margin.abs() > 1e-7 || body.margin == 0.0 {
            assert_eq!(far.is_consistent(), body.margin >= 0.0, "{body:?}");
            assert_eq!(far.is_strictly_consistent(), body.margin > 0.0, "{body:?}");
        }
    }
}

#[test]
fn the_laws_of_inertia_hold() {
    let samples = InertiaSamples {
        clouds: draws(&clouds(8), 4, 300),
        candidates: draws(&judged_bodies(), 5, 1_000).iter().map(|body| body.parameters).collect(),
        poses: draws(&poses(2.0), 6, 10),
    };
    check_inertia(&InertiaOperations::default(), &samples, 1e-11).unwrap();
}

/// Every solid of the crate at a random size, and whether it has extent in every direction.
fn solids(mass: f64, [a, b, c]: [f64; 3]) -> [(Body, bool); 13] {
    let (short, long) = (a.min(b), a.max(b));
    [
        (Body::solid_sphere(mass, a), true),
        (Body::hollow_sphere(mass, short, long), true),
        (Body::hollow_sphere(mass, a, a), true),
        (Body::solid_box(mass, [a, b, c]), true),
        (Body::hollow_box(mass, [0.9 * a, 0.5 * b, c], [a, b, c]), true),
        (Body::solid_cylinder(mass, a, b), true),
        (Body::hollow_cylinder(mass, short, long, c), true),
        (Body::hollow_cylinder(mass, a, a, b), true),
        (Body::solid_ellipsoid(mass, [a, b, c]), true),
        (Body::thin_disc(mass, a), false),
        (Body::thin_plate(mass, [a, b]), false),
        (Body::thin_rod(mass, a), false),
        (Body::point(mass, Vector3::new(a, b, c)), false),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn prop_physical_consistency(
        (mass, size) in (0.01..100.0, [0.02..2.0, 0.02..2.0, 0.02..2.0]),
        pose in poses(3.0),
        robot in bodies(),
        cloud in clouds(6),
    ) {
        for (solid, has_extent) in solids(mass, size) {
            prop_assert!((solid.mass - mass).abs() < 1e-12 * mass);
            // a centred solid moves away from the origin: its numbers grow, none cancels
            let moved = if solid.first_moment == Vector3::zeros() { solid.transformed_by(&pose) } else { solid };
            for body in [solid, moved] {
                prop_assert!(body.is_consistent(), "{body:?}");
                prop_assert_eq!(body.is_strictly_consistent(), has_extent, "{:?}", body);
                prop_assert!(body.validated().is_ok());
                prop_assert_eq!(body.nearest_consistent().unwrap().to_vector(), body.to_vector());
            }
            let combined = robot.with_payload(&solid, &pose);
            prop_assert!(combined.is_strictly_consistent());
            let payload = combined.payload_beside(&robot, &pose);
            let lever = 1.0 + pose.translation.vector.norm_squared();
            let size = combined.to_vector().amax() * lever;
            prop_assert!((payload.to_vector() - solid.to_vector()).amax() <= 1e-12 * size);
        }
        let body = Body::from_points(&cloud);
        prop_assert!(body.is_consistent());
        prop_assert_eq!(body.is_strictly_consistent(), cloud.len() > 3, "{}", body.consistency_margin());
    }

    #[test]
    fn the_log_cholesky_chart_covers_the_bodies(body in bodies(), v in proptest::array::uniform10(-2.0..2.0)) {
        let anything = LogCholesky::from_vector(&SVector::from(v)).to_parameters();
        prop_assert!(anything.is_strictly_consistent());
        let back = LogCholesky::try_from_parameters(&anything).unwrap().to_vector();
        prop_assert!((back - SVector::from(v)).amax() < 1e-8, "{back}");
        let chart = LogCholesky::try_from_parameters(&body).unwrap();
        let scale = body.to_vector().amax();
        prop_assert!((chart.to_parameters().to_vector() - body.to_vector()).amax() < 1e-14 * scale);
    }

    #[test]
    fn shift_and_rotation_undo_and_keep_the_margin(body in judged_bodies(), there in poses(3.0), on in poses(3.0)) {
        let (body, margin) = (body.parameters, body.margin);
        let once = body.transformed_by(&there);
        let size = once.to_vector().amax() * 30.0;
        prop_assert!((once.transformed_by(&there.inverse()).to_vector() - body.to_vector()).amax() < 1e-14 * size);
        let (stepwise, direct) = (once.transformed_by(&on), body.transformed_by(&(on * there)));
        prop_assert!((stepwise.to_vector() - direct.to_vector()).amax() < 1e-14 * size * 30.0);
        let grown = size / body.inertia_about_com().amax().max(1e-14 * size);
        prop_assert!(margin == 0.0 || (once.consistency_margin() - margin).abs() < 1e-14 * grown);
        // energy and momentum do not depend on the frame: M_a = Ad^-T M_b Ad^-1
        let ad = tumble_dynamics::lie::LieGroup::adjoint(&there.inverse());
        let expected = ad.transpose() * body.spatial_inertia() * ad;
        prop_assert!((once.spatial_inertia() - expected).amax() < 1e-13 * size);
        prop_assert!((from_pseudo_inertia(&pseudo_inertia(&once)).to_vector() - once.to_vector()).amax() < 1e-15 * size);
        let chapter_5 = ParameterOrder::DualQuaternion;
        prop_assert_eq!(chapter_5.unpack(&chapter_5.pack(&once.to_vector())), once.to_vector());
    }

    #[test]
    fn projection_scales_with_the_numbers(
        body in prop_oneof![impossible_bodies(), near_boundary_bodies(), boundary_bodies()],
        decades in -9..9,
    ) {
        // the norm adds squares of kg, kg m and kg m^2, so only a common factor is a symmetry
        let factor = 10f64.powi(decades);
        let nearest = body.parameters.nearest_consistent().unwrap();
        let scaled = (body.parameters * factor).nearest_consistent().unwrap() * (1.0 / factor);
        let size = body.parameters.to_vector().amax();
        let distance = |other: &Body| (other.to_vector() - body.parameters.to_vector()).norm();
        prop_assert!((distance(&nearest) - distance(&scaled)).abs() < 1e-10 * size);
        prop_assert!((nearest.to_vector() - scaled.to_vector()).amax() < 1e-6 * size);
        prop_assert!(nearest.is_consistent(), "{:e}", nearest.consistency_margin());
        prop_assert_eq!(nearest.nearest_consistent().unwrap().to_vector(), nearest.to_vector());
        // a core keeps the answer away from the boundary
        let core = Body::solid_sphere(1e-3 * size, 0.1);
        let kept = (body.parameters - core).nearest_consistent().unwrap() + core;
        prop_assert!(kept.is_strictly_consistent());
    }
}

#[test]
fn negative_and_missing_mass() {
    let body = Body::solid_sphere(2.0, 0.1);
    assert!(!(body * -1.0).is_consistent());
    let nothing = body * 0.0;
    assert!(nothing.is_consistent() && !nothing.is_strictly_consistent());
    assert!(LogCholesky::try_from_parameters(&Body::thin_rod(1.0, 2.0)).is_err());
    let projected = (body * -1.0).nearest_consistent().unwrap();
    assert!(projected.is_consistent());
    assert!(projected.to_vector().amax() < 1e-7, "the nearest body to the opposite of a body is none: {projected:?}");
}
