//! Many missions by chance, and how long their stretches take.

use super::flight::{Flown, Scene, at_rest, belief, fly, way};
use crate::{FULL, PLANAR_COM, PRINCIPAL, by_covariance, fixed, room, slalom};
use nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::ModelBelief;
use tumble_planning::dynamics::RigidBodyState;
use tumble_planning::local::{PlanarBodyModel, RigidBodyModel};
use tumble_planning::mission::{StretchModel, StretchSettings};

struct Draw(u64);

impl Draw {
    fn within(&mut self, least: f64, most: f64) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        least + (most - least) * ((self.0 >> 11) as f64 / (1_u64 << 53) as f64)
    }

    fn vector(&mut self, size: &Vector3<f64>) -> Vector3<f64> {
        size.map(|size| self.within(-size, size))
    }
}

fn quantile(values: impl Iterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

fn show(name: &str, flights: &[Flown]) {
    let arrived = flights.iter().filter(|flown| flown.arrived).count();
    let ms = |share: f64| quantile(flights.iter().flat_map(|flown| flown.core_ms.iter().copied()), share);
    let most = |of: &dyn Fn(&Flown) -> f64| quantile(flights.iter().map(of), 1.0);
    let middle = |of: &dyn Fn(&Flown) -> f64| quantile(flights.iter().map(of), 0.5);
    println!("{name}: {arrived} of {} arrived; ms {:.1} {:.1} {:.1}", flights.len(), ms(0.5), ms(0.99), ms(1.0));
    println!(
        "  units {} clearance {:.4} input {:.3} speed {:.3} rate {:.3} ends {:.4} m {:.4} m/s late {:.1} s, {:.1} s",
        flights.iter().flat_map(|flown| flown.units.iter()).max().unwrap_or(&0),
        -most(&|flown| -flown.clearance_m),
        most(&|flown| flown.input),
        most(&|flown| flown.speed),
        most(&|flown| flown.rate),
        most(&|flown| flown.end_m),
        most(&|flown| flown.end_m_s),
        middle(&|flown| flown.arrival_s - flown.way_s),
        most(&|flown| flown.arrival_s - flown.way_s),
    );
    for stretches in [1, 2, 20] {
        let left = |quantity: usize| {
            middle(&|flown| flown.sigma.iter().take(stretches).map(|each| each[quantity]).product::<f64>())
        };
        let left: Vec<f64> = (0..flights[0].sigma[0].len()).map(left).collect();
        println!("  sigma left after {stretches}: {left:.3?}");
    }
    println!("  impulse {:.3} N s, {:.3} N m s", middle(&|flown| flown.impulse[0]), middle(&|flown| flown.impulse[1]));
}

fn missions<M, const X: usize, const U: usize, const P: usize>(
    name: &str,
    model: &M,
    scene: &Scene,
    settings: &StretchSettings,
    places: &[usize; P],
    count: u64,
) where
    M: StretchModel<X, U, P> + Clone,
{
    let flat = if scene.is_planar { 0.0 } else { 1.0 };
    let (moved, turned) = (Vector3::new(1.0, 1.0, flat), Vector3::new(flat, flat, 1.0));
    let masses = if scene.is_planar { [8.0_f64, 30.0] } else { [5.0, 20.0] };
    for relative in [Some(0.0), Some(1.0), Some(10.0), Some(100.0), None] {
        let mut draw = Draw(88_172_645_463_325_252);
        let mut flights = Vec::new();
        for seed in 0..count {
            let mass = f64::exp(draw.within(masses[0].ln(), masses[1].ln()));
            let center = draw.vector(&(moved * (0.1 / f64::sqrt(3.0))));
            let unknown = [draw.within(0.02, 0.3), draw.within(0.002, 0.03), draw.within(0.05, 0.5)];
            let belief: ModelBelief = belief(mass, center, unknown);
            let mut start: RigidBodyState<f64> = at_rest(scene.start);
            let away = if scene.is_planar { 0.004 } else { 0.01 };
            start.world_from_body.translation.vector += draw.vector(&(moved * away));
            start.world_from_body.rotation *= UnitQuaternion::from_scaled_axis(draw.vector(&(turned * 0.02)));
            start.twist_body.linear = draw.vector(&(moved * 0.002));
            start.twist_body.angular = draw.vector(&(turned * 0.005));
            let Some(way) = way(scene, &belief, settings, 20_000, seed) else {
                println!("{name}: no way for seed {seed}");
                continue;
            };
            let weighting =
                relative.map_or_else(|| by_covariance(&belief, places), |relative| fixed(&belief, places, relative));
            flights.push(fly(model.clone(), scene, &way, &belief, settings, weighting, places, start));
        }
        show(&format!("{name}, weight {relative:?}"), &flights);
    }
}

#[test]
#[ignore = "prints what many missions come to; in release"]
fn draws() {
    const COUNT: u64 = 100;
    let settings = StretchSettings::default();
    missions("slalom, 4", &RigidBodyModel::principal(), &slalom(), &settings, &PRINCIPAL, COUNT);
    missions("slalom, 10", &RigidBodyModel::full(), &slalom(), &settings, &FULL, COUNT);
    let settings = StretchSettings { margin_m: 0.005, ..settings };
    let room = room();
    let model = PlanarBodyModel::full().at_height(room.start.translation.z);
    missions("room, 4", &model, &room, &settings, &PLANAR_COM, COUNT);
}
