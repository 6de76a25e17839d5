//! A collision world of one's own: a floor of blocks, as a height map has them, in thirty lines.
//!
//! `clearance` and `reach_m` are all it takes; `conservative_first_contact` makes a certified continuous test of them.

use tumble_planning::collision::{Blocker, Clearance, CollisionWorld, Contact, conservative_first_contact};
use tumble_planning::laws::{CollisionSample, check_collision_world};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{UnitQuaternion, Vector3};
use tumble_planning::{BodyArc, PlanningError, TranslationState};

/// Heights of square blocks that stand on z = 0, the first one between the origin and (side, side).
struct HeightMap {
    side_m: f64,
    heights_m: Vec<Vec<f64>>,
}

/// A ball at the end of a boom along the body's x axis.
struct BallOnBoom {
    boom_m: f64,
    radius_m: f64,
}

impl CollisionWorld for HeightMap {
    type Body = BallOnBoom;

    fn clearance(
        &self,
        body: &BallOnBoom,
        world_from_body: &Pose<f64>,
        _time_s: f64,
    ) -> Result<Clearance, PlanningError> {
        let center = world_from_body.transform_point(&(Vector3::x() * body.boom_m).into()).coords;
        let mut nearest = Clearance { distance_m: f64::INFINITY, nearest: None };
        let rows = self.heights_m.iter().enumerate();
        let blocks =
            rows.flat_map(|(row, heights)| heights.iter().enumerate().map(move |(column, h)| (row, column, h)));
        for (index, (row, column, height_m)) in blocks.enumerate() {
            let low = Vector3::new(row as f64, column as f64, 0.0) * self.side_m;
            let high = low + Vector3::new(self.side_m, self.side_m, *height_m);
            let beyond = (low - center).sup(&(center - high));
            let inside_m = beyond.max().min(0.0);
            let distance_m = beyond.sup(&Vector3::zeros()).norm() + inside_m - body.radius_m;
            if distance_m < nearest.distance_m {
                nearest = Clearance { distance_m, nearest: Some(Blocker::Obstacle(index)) };
            }
        }
        Ok(nearest)
    }

    fn first_contact(
        &self,
        body: &BallOnBoom,
        arc: &BodyArc,
        start_s: f64,
        margin_m: f64,
    ) -> Result<Option<Contact>, PlanningError> {
        conservative_first_contact(self, body, arc, start_s, margin_m, 1e-9)
    }

    fn is_still_from(&self, _time_s: f64) -> bool {
        true
    }

    fn lasting_clearance(
        &self,
        body: &BallOnBoom,
        world_from_body: &Pose<f64>,
        from_s: f64,
    ) -> Result<Clearance, PlanningError> {
        self.clearance(body, world_from_body, from_s)
    }

    fn reach_m(&self, body: &BallOnBoom) -> f64 {
        body.boom_m + body.radius_m
    }
}

fn terrain() -> HeightMap {
    HeightMap { side_m: 0.5, heights_m: vec![vec![0.1, 0.1, 0.1], vec![0.1, 1.0, 0.1], vec![0.1, 0.1, 0.1]] }
}

fn flight(from: Vector3<f64>, to: Vector3<f64>, angle_rad: f64) -> BodyArc {
    let start = TranslationState { position: from, velocity: (to - from) / 10.0 };
    let mut angle = [0.0; 6];
    angle[1] = angle_rad / 10.0;
    BodyArc::accelerated(10.0, &start, Vector3::zeros(), UnitQuaternion::identity()).turning(Vector3::z_axis(), angle)
}

#[test]
fn a_tower_is_hit_exactly_when_the_ball_reaches_it() {
    let (map, body) = (terrain(), BallOnBoom { boom_m: 0.0, radius_m: 0.1 });
    // At half the tower's height, along its middle: contact where the centre is a radius before its face at x = 0.5.
    let into = flight(Vector3::new(-0.6, 0.75, 0.5), Vector3::new(1.4, 0.75, 0.5), 0.0);
    let contact = map.first_contact(&body, &into, 0.0, 0.0).unwrap().unwrap();
    assert_eq!(contact.blocker, Blocker::Obstacle(4));
    assert!((contact.time_s - 5.0).abs() < 1e-7, "{}", contact.time_s);
    let over = flight(Vector3::new(-0.6, 0.75, 1.1001), Vector3::new(1.4, 0.75, 1.1001), 0.0);
    assert_eq!(map.first_contact(&body, &over, 0.0, 0.0).unwrap(), None);
    assert!(map.first_contact(&body, &over, 0.0, 0.001).unwrap().is_some());
}

#[test]
fn a_boom_swings_into_what_its_body_passes() {
    let (map, body) = (terrain(), BallOnBoom { boom_m: 0.4, radius_m: 0.05 });
    let passing = |angle| flight(Vector3::new(0.1, 0.2, 0.5), Vector3::new(0.1, 0.8, 0.5), angle);
    assert!(map.first_contact(&body, &passing(0.0), 0.0, 0.0).unwrap().is_some());
    assert_eq!(map.first_contact(&body, &passing(std::f64::consts::PI), 0.0, 0.0).unwrap(), None);
}

#[test]
fn the_height_map_keeps_the_laws_of_collision_worlds() {
    let corner = |bits: u32| Vector3::from_fn(|axis, _| if bits >> axis & 1 == 0 { -0.3 } else { 1.7 });
    let edges = (0..8).flat_map(|from| (0..8).map(move |to| flight(corner(from), corner(to), f64::from(to) - 3.0)));
    let sample = |arc| CollisionSample { arc, start_s: 0.0, margin_m: 0.01 };
    let samples: Vec<CollisionSample> = edges.map(sample).collect();
    check_collision_world(&terrain(), &BallOnBoom { boom_m: 0.2, radius_m: 0.1 }, &samples, 2e-9).unwrap();
}
