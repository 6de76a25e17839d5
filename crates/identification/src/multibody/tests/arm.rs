//! A free base with two links: what momentum tells of it, and what not.

use super::*;
use nalgebra::Rotation3;

/// Rows [linear; angular] of the momentum about the inertial origin.
fn momentum_rows(r: &Matrix3<f64>, p: Vector3<f64>, w: Vector3<f64>, v: Vector3<f64>) -> SMatrix<f64, 6, 10> {
    let wb = r.transpose() * w;
    let g = SMatrix::<f64, 3, 6>::new(
        wb.x, wb.y, wb.z, 0.0, 0.0, 0.0, 0.0, wb.x, 0.0, wb.y, wb.z, 0.0, 0.0, 0.0, wb.x, 0.0, wb.y, wb.z,
    );
    let mut rows = SMatrix::<f64, 6, 10>::zeros();
    rows.fixed_view_mut::<3, 1>(0, 0).copy_from(&v);
    rows.fixed_view_mut::<3, 3>(0, 1).copy_from(&(w.cross_matrix() * r));
    rows.fixed_view_mut::<3, 1>(3, 0).copy_from(&p.cross(&v));
    let by_moment = p.cross_matrix() * w.cross_matrix() * r - v.cross_matrix() * r;
    rows.fixed_view_mut::<3, 3>(3, 1).copy_from(&by_moment);
    rows.fixed_view_mut::<3, 6>(3, 4).copy_from(&(r * g));
    rows
}

/// A base, a link turning about its z and one turning about that one's y; 30 columns. `turning` false: welded together.
fn arm_rows(dice: &mut Gaussian, turning: bool) -> SMatrix<f64, 6, 30> {
    let rate = |dice: &mut Gaussian| if turning { 2.0 * (2.0 * dice.uniform() - 1.0) } else { 0.0 };
    let r0 = Rotation3::new(dice.vector(1.0)).into_inner();
    let (p0, w0, v0) = (dice.vector(1.0), dice.vector(1.0), dice.vector(1.0));
    let mut rows = SMatrix::<f64, 6, 30>::zeros();
    rows.fixed_columns_mut::<10>(0).copy_from(&momentum_rows(&r0, p0, w0, v0));
    let (mut r, mut p, mut w, mut v) = (r0, p0, w0, v0);
    let joints = [(Vector3::new(0.2, 0.05, 0.1), Vector3::z()), (Vector3::new(0.3, 0.0, 0.02), Vector3::y())];
    for (link, (place, axis)) in joints.into_iter().enumerate() {
        let angle = 2.0 * rate(dice);
        v += w.cross(&(r * place));
        p += r * place;
        w += r * axis * rate(dice);
        r *= Rotation3::new(axis * angle).into_inner();
        rows.fixed_columns_mut::<10>(10 * (link + 1)).copy_from(&momentum_rows(&r, p, w, v));
    }
    rows
}

/// Three bodies: mass, centre of mass and inertia about it.
fn arm_truth() -> DVector<f64> {
    let body = |m: f64, c: [f64; 3], j: [f64; 6]| {
        let c = Vector3::from(c);
        let about_center = Matrix3::new(j[0], j[1], j[2], j[1], j[3], j[4], j[2], j[4], j[5]);
        let shift = (Matrix3::identity() * c.norm_squared() - c * c.transpose()) * m;
        let j = about_center + shift;
        [m, m * c.x, m * c.y, m * c.z, j[(0, 0)], j[(0, 1)], j[(0, 2)], j[(1, 1)], j[(1, 2)], j[(2, 2)]]
    };
    let base = body(10.0, [0.02, -0.01, 0.03], [0.5, 0.01, -0.02, 0.6, 0.03, 0.7]);
    let link1 = body(1.5, [0.15, 0.01, 0.0], [0.01, -0.002, 0.001, 0.06, 0.0005, 0.062]);
    let link2 = body(1.0, [0.12, 0.0, 0.01], [0.005, 0.0003, -0.001, 0.03, 0.0002, 0.031]);
    DVector::from_iterator(30, [base, link1, link2].into_iter().flatten())
}

fn arm_layout() -> ParameterLayout {
    let bodies =
        vec![unknown_body("base", 10.0, 0.25), unknown_body("link1", 1.5, 0.25), unknown_body("link2", 1.0, 0.2)];
    ParameterLayout::try_new(bodies, vec![]).unwrap()
}

/// Momentum of the arm in `samples` states, with noise of this standard deviation in all six.
fn arm_information(samples: usize, turning: bool, noise: f64, seed: u64) -> LinkInformation {
    let (mut dice, truth) = (Gaussian::from_seed(seed), arm_truth());
    let mut information = LinkInformation::new(30);
    for _ in 0..samples {
        let rows = arm_rows(&mut dice, turning);
        let whitened: Vec<f64> = rows.transpose().iter().map(|entry| entry / noise).collect();
        let rhs: Vec<f64> = (rows * &truth).iter().map(|y| y / noise + dice.normal()).collect();
        information.add_rows(&whitened, &rhs).unwrap();
    }
    information
}

#[test]
fn a_free_arm_with_two_hinges_has_24_base_parameters() {
    let layout = arm_layout();
    let information = arm_information(60, true, 1e-3, 1);
    let base = BaseParameters::new(&information, &layout).unwrap();
    assert_eq!(base.rank(), 24);
    check_base_parameters(&base, &information, 1e-10).unwrap();
    let words: Vec<String> = base.indistinguishable_changes().iter().map(ToString::to_string).collect();
    let about_z = "cannot be told apart: +1 kg m of `link1.h_z` is undone by";
    assert!(words.iter().any(|words| words.contains(about_z)), "{words:#?}");
    // The total mass is known, that of a link is not.
    let total: Vec<f64> = (0..30).map(|j| f64::from(u8::from(j % 10 == 0))).collect();
    let value = base.linear_value(&total).unwrap().unwrap();
    assert!((value.value - 12.5).powi(2) < 16.0 * value.variance, "{value:?}");
    for body in 0..3 {
        assert_eq!(base.mass_variance(body).unwrap(), None);
        assert_eq!(base.center_of_mass_covariance(body, &arm_truth()).unwrap(), None);
    }
}

#[test]
fn a_welded_arm_says_so_in_words() {
    // Two bodies, the second 0.3 m along x, in one piece: their sum about the first origin is all there is.
    let mut information = LinkInformation::new(21);
    let mut dice = Gaussian::from_seed(3);
    for _ in 0..40 {
        let r = Rotation3::new(dice.vector(1.0)).into_inner();
        let (p, w, v) = (dice.vector(1.0), dice.vector(1.0), dice.vector(1.0));
        let offset = r * Vector3::new(0.3, 0.0, 0.0);
        let (first, second) = (momentum_rows(&r, p, w, v), momentum_rows(&r, p + offset, w, v + w.cross(&offset)));
        for i in 0..6 {
            let row: Vec<f64> = first.row(i).iter().chain(second.row(i).iter()).copied().chain([0.0]).collect();
            information.add_rows(&row, &[0.0]).unwrap();
        }
    }
    let bodies = vec![unknown_body("link1", 1.0, 1.0), unknown_body("link2", 1.0, 1.0)];
    let friction = nuisance("viscous friction of joint 1", 0.1, Some(0.0));
    let layout = ParameterLayout::try_new(bodies, vec![friction]).unwrap();
    let base = BaseParameters::new(&information, &layout).unwrap();
    assert_eq!((base.rank(), base.indistinguishable_changes().len()), (10, 11));
    check_base_parameters(&base, &information, 1e-10).unwrap();
    let words: Vec<String> = base.indistinguishable_changes().iter().map(ToString::to_string).collect();
    let formulas: Vec<String> = base.base_parameters().iter().map(ToString::to_string).collect();
    let has = |all: &[String], wanted: &str| assert!(all.iter().any(|words| words == wanted), "{wanted}: {all:#?}");
    has(&words, "`viscous friction of joint 1` is not excited: no measurement notices it");
    has(
        &words,
        "`link2.J_zz` and `link1.J_zz` cannot be told apart: +1 kg m^2 of `link2.J_zz` is undone by -1 kg m^2 `link1.J_zz`",
    );
    has(&formulas, "`link1.mass` + `link2.mass`");
    has(&formulas, "`link1.J_zz` + 0.09 `link2.mass` + 0.6 `link2.h_x` + `link2.J_zz`");
    // A tolerance that takes rounding for excitement misses directions, and the law says which.
    let blind = BaseParameters::with_tolerance(&information, &layout, 0.0).unwrap();
    let broken = check_base_parameters(&blind, &information, 1e-10).unwrap_err();
    assert_eq!(broken.law, "rank is that of the data");
}

#[test]
fn base_parameters_are_estimated_with_an_honest_covariance() {
    let layout = arm_layout();
    let (mut squares, runs) = (0.0, 40);
    for seed in 0..runs {
        let information = arm_information(25, true, 1e-2, 1000 * (seed + 1));
        let base = BaseParameters::new(&information, &layout).unwrap();
        let truth =
            DVector::from_iterator(24, base.base_parameters().iter().map(|base| base.factors().dot(&arm_truth())));
        let error = base.estimates() - truth;
        let whitened = base.covariance().cholesky().unwrap().l().solve_lower_triangular(&error).unwrap();
        squares += whitened.norm_squared();
        let variance = base.residual_variance().unwrap();
        assert!((variance - 1.0).abs() < 5.0 * (2.0_f64 / 126.0).sqrt(), "{variance}");
    }
    // χ² with 24 · 40 degrees of freedom: five standard deviations.
    let freedom = 24.0 * runs as f64;
    assert!((squares - freedom).abs() < 5.0 * (2.0 * freedom).sqrt(), "{squares} of {freedom}");
    // The covariance is the inverse of the information of the base columns.
    let information = arm_information(25, true, 1e-2, 7);
    let base = BaseParameters::new(&information, &layout).unwrap();
    let columns: Vec<usize> = base.base_parameters().iter().map(|base| base.terms()[0].column).collect();
    let independent = information.factor().select_columns(&columns);
    let inverse = (independent.transpose() * &independent).try_inverse().unwrap();
    let correlation = |i: usize, j: usize| (inverse[(i, i)] * inverse[(j, j)]).sqrt();
    let covariance = base.covariance();
    for i in 0..24 {
        for j in 0..24 {
            let difference = (covariance[(i, j)] - inverse[(i, j)]).abs();
            assert!(difference < 1e-6 * correlation(i, j), "{i} {j} {difference:e}");
        }
    }
}

#[test]
fn where_nothing_binds_the_data_and_the_prior_each_decide_their_own() {
    let layout = arm_layout();
    let information = arm_information(200, true, 1e-4, 5);
    let base = BaseParameters::new(&information, &layout).unwrap();
    // A nominal arm that is off by a few percent.
    let mut dice = Gaussian::from_seed(6);
    let magnitudes = layout.magnitudes();
    let nominal: Vec<f64> =
        arm_truth().iter().zip(&magnitudes).map(|(x, size)| x + 0.01 * size * (2.0 * dice.uniform() - 1.0)).collect();
    let deviations: Vec<f64> = (0..30).map(|_| 0.05 * (1.5 + (2.0 * dice.uniform() - 1.0))).collect();
    let prior = LinkPrior::try_new(&layout, &nominal, &deviations).unwrap();
    let estimate = ConsistentLinks::new(&base, &prior).unwrap().solve().unwrap();
    assert!(!estimate.is_active());
    assert_eq!((estimate.misfit, estimate.duality_gap), (0.0, 0.0));
    let heavy = ConsistentLinks::new(&base, &prior).unwrap().with_prior_weight(1e3).solve().unwrap();
    assert_eq!(estimate.unknowns, heavy.unknowns);
    // Least squares with a vanishing prior tends to it: the prior as rows, a hundred times weaker.
    let mut regularised = information.clone();
    for i in 0..30 {
        let mut row = [0.0; 30];
        row[i] = 1e-2 / (deviations[i] * magnitudes[i]);
        regularised.add_rows(&row, &[row[i] * nominal[i]]).unwrap();
    }
    let full = BaseParameters::new(&regularised, &layout).unwrap();
    assert_eq!(full.rank(), 30);
    for i in 0..30 {
        let unit: Vec<f64> = (0..30).map(|j| f64::from(u8::from(i == j))).collect();
        let value = full.linear_value(&unit).unwrap().unwrap().value;
        assert!((value - estimate.unknowns[i]).abs() < 1e-6 * magnitudes[i], "{i}: {value} {}", estimate.unknowns[i]);
    }
    let origins: Vec<Origin> = (0..30).filter_map(|column| estimate.origin(column)).collect();
    assert_eq!(origins[0], Origin::Both);
    assert!(origins.contains(&Origin::Data) && !origins.contains(&Origin::Prior));
    assert_eq!(estimate.origin(30), None);
}
