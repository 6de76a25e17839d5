//! Stretches of whole missions: arrival, limits, information.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod stretches {
    pub mod flight;
}

use nalgebra::{SMatrix, Vector3};
use stretches::flight::*;
use tumble_planning::ModelBelief;
use tumble_planning::local::{
    FixedWeighting, InformationWeighting, PlanarBodyModel, RigidBodyModel, body_by_mass_center_and_inertia,
    body_by_principal,
};
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
    let all: Vec<f64> = if P == 4 {
        vec![w / m / m, w / i / i, w / i / i, w / i / i]
    } else {
        vec![
            w / m / m,
            w / c / c,
            w / c / c,
            w / c / c,
            w / i / i,
            w / i / i,
            w / i / i,
            w / i / i,
            w / i / i,
            w / i / i,
        ]
    };
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
            let way = way(&scene, &belief, &WAY, 20_000, 1).unwrap();
            println!(
                "m {mass} com {com}: way {:.1} s, {} arcs, {:.0} ms",
                way.duration_s(),
                way.arcs().len(),
                clock.elapsed().as_secs_f64() * 1e3
            );
            for relative in [0.0, 1.0, 10.0, 100.0] {
                let four = fly(
                    RigidBodyModel::principal(),
                    &scene,
                    &way,
                    &belief,
                    &settings,
                    weights(&belief, relative),
                    learned4,
                    at_rest(scene.start),
                );
                show("4 ", relative, &four);
                let ten = fly(
                    RigidBodyModel::full(),
                    &scene,
                    &way,
                    &belief,
                    &settings,
                    weights(&belief, relative),
                    learned10,
                    at_rest(scene.start),
                );
                show("10", relative, &ten);
            }
        }
    }
}

fn show(name: &str, relative: f64, f: &Flown) {
    let mut total = vec![1.0; f.sigma.first().map_or(0, Vec::len)];
    for s in &f.sigma {
        for (t, s) in total.iter_mut().zip(s) {
            *t *= s;
        }
    }
    println!(
        "  {name} w {relative}: {} {} stretches {:.0}/{:.1} s clear {:.3} input {:.3} speed {:.3} end {:.3} m {:.4} m/s  F {:.2} T {:.3} Ns  err {:.4?} ms {:.0?} it {:?}\n       sigma {:.3?}",
        if f.refused {
            "REFUSED"
        } else if f.arrived {
            "arrived"
        } else {
            "LOST"
        },
        f.stretches,
        f.duration_s,
        f.way_s,
        f.clearance_m,
        f.input,
        f.speed,
        f.end_m,
        f.end_m_s,
        f.impulse[0],
        f.impulse[1],
        f.end_error,
        f.wall_ms,
        f.iterations,
        total
    );
}

#[test]
#[ignore = "a study"]
fn planar() {
    let scene = room();
    let settings = StretchSettings { margin_m: 0.005, ..StretchSettings::default() };
    for mass in [12.0, 19.0, 30.0] {
        let belief = belief(mass, Vector3::new(0.0, -0.1, 0.0), [0.1, 0.02, 0.33]);
        let way = way(&scene, &belief, &WayShare { margin_m: 0.01, ..WAY }, 20_000, 1).unwrap();
        println!("m {mass}: way {:.1} s", way.duration_s());
        for relative in [0.0, 1.0, 10.0, 100.0] {
            let w: Box<dyn InformationWeighting<2>> =
                Box::new(FixedWeighting::try_new([relative / mass / mass, relative / 0.04]).unwrap());
            let two = fly(
                PlanarBodyModel::mass_and_inertia().at_height(-0.76),
                &scene,
                &way,
                &belief,
                &settings,
                w,
                |b, _| b.clone(),
                at_rest(scene.start),
            );
            show("p2", relative, &two);
        }
    }
}

fn env(name: &str, otherwise: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(otherwise)
}

struct Draw(u64);
impl Draw {
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / 9_007_199_254_740_992.0
    }
    fn within(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }
    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::new(self.within(-size, size), self.within(-size, size), self.within(-size, size))
    }
}

fn tally(name: &str, flights: &[Flown]) {
    let n = flights.len();
    let arrived = flights.iter().filter(|f| f.arrived).count();
    let mut ms: Vec<f64> = flights.iter().flat_map(|f| f.wall_ms.clone()).collect();
    ms.sort_by(f64::total_cmp);
    let mut first: Vec<f64> = flights.iter().map(|f| f.wall_ms[0]).collect();
    first.sort_by(f64::total_cmp);
    let q = |v: &[f64], q: f64| v[((v.len() - 1) as f64 * q).round() as usize];
    let worst = |f: &dyn Fn(&Flown) -> f64| flights.iter().map(f).fold(f64::NEG_INFINITY, f64::max);
    let mean = |f: &dyn Fn(&Flown) -> f64| flights.iter().map(f).sum::<f64>() / n as f64;
    println!(
        "{name}: arrived {arrived}/{n} refused {} | ms p50 {:.1} p99 {:.1} max {:.1}, first p50 {:.1} p99 {:.1} | units max {} | clear {:.4} input {:.4} speed {:.3} end {:.3} m {:.4} m/s | late {:.1} mean, {:.1} s worst | F {:.2} T {:.3}",
        flights.iter().filter(|f| f.refused).count(),
        q(&ms, 0.5),
        q(&ms, 0.99),
        q(&ms, 1.0),
        q(&first, 0.5),
        q(&first, 0.99),
        flights.iter().flat_map(|f| f.units.clone()).max().unwrap_or(0),
        -worst(&|f| -f.clearance_m),
        worst(&|f| f.input),
        worst(&|f| f.speed),
        worst(&|f| f.end_m),
        worst(&|f| f.end_m_s),
        mean(&|f| f.duration_s - f.way_s),
        worst(&|f| f.duration_s - f.way_s),
        mean(&|f| f.impulse[0]),
        mean(&|f| f.impulse[1])
    );
    let p = flights[0].sigma[0].len();
    for upto in [1, 2, 20] {
        let medians: Vec<f64> = (0..p)
            .map(|i| {
                let mut all: Vec<f64> =
                    flights.iter().map(|f| f.sigma.iter().take(upto).map(|s| s[i]).product()).collect();
                all.sort_by(f64::total_cmp);
                q(&all, 0.5)
            })
            .collect();
        println!("    sigma left after {upto}: {medians:.3?}");
    }
}

#[test]
#[ignore = "a study"]
fn draws() {
    let n = env("N", 100.0) as usize;
    let scene = slalom();
    let mut settings = StretchSettings::default();
    settings.margin_m = 0.04;
    settings.tolerance = env("TOL", 1e-3);
    settings.iterations = env("IT", 100.0) as usize;
    let samples = env("SAMPLES", 1.0);
    settings.samples_per_step = samples;
    for relative in [0.0, 1.0, 10.0, 100.0] {
        if env("W", relative) != relative {
            continue;
        }
        let (mut four, mut ten, mut none) = (vec![], vec![], 0);
        let mut draw = Draw(88_172_645_463_325_252);
        for k in 0..n {
            let mass = f64::exp(draw.within(f64::ln(5.0), f64::ln(20.0)));
            let com = draw.vector(0.1 / f64::sqrt(3.0));
            let belief = belief(mass, com, [draw.within(0.02, 0.3), draw.within(0.002, 0.03), draw.within(0.05, 0.5)]);
            let Some(way) = way(&scene, &belief, &WAY, 20_000, k as u64) else {
                none += 1;
                continue;
            };
            let mut start = at_rest(scene.start);
            start.world_from_body.translation.vector += draw.vector(0.01);
            start.world_from_body.rotation = start.world_from_body.rotation
                * tumble_planning::nalgebra::UnitQuaternion::from_scaled_axis(draw.vector(0.02));
            start.twist_body.linear = draw.vector(0.002);
            start.twist_body.angular = draw.vector(0.005);
            four.push(fly(
                RigidBodyModel::principal(),
                &scene,
                &way,
                &belief,
                &settings,
                weights(&belief, relative),
                learned4,
                start,
            ));
            ten.push(fly(
                RigidBodyModel::full(),
                &scene,
                &way,
                &belief,
                &settings,
                weights(&belief, relative),
                learned10,
                start,
            ));
        }
        println!("no way: {none}");
        tally(&format!("4 w {relative}"), &four);
        tally(&format!("10 w {relative}"), &ten);
    }
}
