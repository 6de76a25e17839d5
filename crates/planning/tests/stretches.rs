//! Stretches of whole missions: arrival, limits, information.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod stretches {
    pub mod flight;
}

use nalgebra::{SMatrix, Vector3};
use stretches::flight::*;
use tumble_planning::ModelBelief;
use tumble_planning::local::{FixedWeighting, InformationWeighting, PlanarBodyModel, RigidBodyModel, body_by_principal, body_by_mass_center_and_inertia};
use tumble_planning::mission::StretchSettings;

fn learned4(belief: &ModelBelief, covariance: &SMatrix<f64, 4, 4>) -> ModelBelief {
    let mut next = belief.clone();
    let by = body_by_mass_center_and_inertia(belief.parameters());
    let places = [0, 4, 7, 9];
    let back = by.try_inverse().unwrap();
    let mut central = back * belief.estimate.covariance * back.transpose();
    for i in 0..4 {
        for j in 0..4 {
            central[(places[i], places[j])] = covariance[(i, j)];
        }
    }
    next.estimate.covariance = by * central * by.transpose();
    next
}
fn learned10(belief: &ModelBelief, covariance: &SMatrix<f64, 10, 10>) -> ModelBelief {
    let mut next = belief.clone();
    let by = body_by_mass_center_and_inertia(belief.parameters());
    next.estimate.covariance = by * covariance * by.transpose();
    next
}

fn weights<const P: usize>(belief: &ModelBelief, relative: f64) -> Box<dyn InformationWeighting<P>> {
    let body = belief.parameters();
    let i = body.inertia_about_com().trace() / 3.0;
    let w = relative;
    let m = body.mass;
    let c = f64::sqrt(1.5 * i / m);
    let all: Vec<f64> = if P == 4 { vec![w/m/m, w/i/i, w/i/i, w/i/i] } else { vec![w/m/m, w/c/c, w/c/c, w/c/c, w/i/i, w/i/i, w/i/i, w/i/i, w/i/i, w/i/i] };
    Box::new(FixedWeighting::try_new(core::array::from_fn(|k| all[k])).unwrap())
}

#[test]
#[ignore = "a study"]
fn study() {
    let _ = body_by_principal;
    let scene = slalom();
    let settings = StretchSettings::default();
    for mass in [5.0, 9.58, 15.0, 20.0] {
        for com in [0.0, 0.1] {
            let belief = belief(mass, Vector3::new(1.0, 1.0, 1.0).normalize() * com, [0.1, 0.02, 0.33]);
            let clock = std::time::Instant::now();
            let way = way(&scene, &belief, &WAY, 20_000, 1);
            println!("m {mass} com {com}: way {:.1} s, {} arcs, {:.0} ms", way.duration_s(), way.arcs().len(), clock.elapsed().as_secs_f64()*1e3);
            for relative in [0.0, 1.0, 10.0, 100.0] {
                let four = fly(RigidBodyModel::principal(), &scene, &way, &belief, &settings, weights(&belief, relative), learned4, at_rest(scene.start));
                show("4 ", relative, &four);
                let ten = fly(RigidBodyModel::full(), &scene, &way, &belief, &settings, weights(&belief, relative), learned10, at_rest(scene.start));
                show("10", relative, &ten);
            }
        }
    }
}

fn show(name: &str, relative: f64, f: &Flown) {
    let mut total = vec![1.0; f.sigma.first().map_or(0, Vec::len)];
    for s in &f.sigma { for (t, s) in total.iter_mut().zip(s) { *t *= s; } }
    println!("  {name} w {relative}: {} {} stretches {:.0}/{:.1} s clear {:.3} input {:.3} speed {:.3} end {:.3} m {:.4} m/s  F {:.2} T {:.3} Ns  err {:.4?} ms {:.0?} it {:?}\n       sigma {:.3?}",
        if f.refused {"REFUSED"} else if f.arrived {"arrived"} else {"LOST"}, f.stretches, f.duration_s, f.way_s, f.clearance_m, f.input, f.speed, f.end_m, f.end_m_s, f.impulse[0], f.impulse[1], f.end_error, f.wall_ms, f.iterations, total);
}

#[test]
#[ignore = "a study"]
fn planar() {
    let scene = room();
    let settings = StretchSettings::default();
    for mass in [12.0, 19.0, 30.0] {
        let belief = belief(mass, Vector3::new(0.0, -0.1, 0.0), [0.1, 0.02, 0.33]);
        let way = way(&scene, &belief, &WAY, 20_000, 1);
        println!("m {mass}: way {:.1} s", way.duration_s());
        for relative in [0.0, 1.0, 10.0, 100.0] {
            let w: Box<dyn InformationWeighting<2>> = Box::new(FixedWeighting::try_new([relative/mass/mass, relative/0.04]).unwrap());
            let two = fly(PlanarBodyModel::mass_and_inertia().at_height(-0.76), &scene, &way, &belief, &settings, w, |b, _| b.clone(), at_rest(scene.start));
            show("p2", relative, &two);
        }
    }
}
