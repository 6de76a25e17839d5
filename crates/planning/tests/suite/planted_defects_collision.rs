//! Every law of collision worlds catches a deliberately broken world, by name.

use crate::sweep_oracle::Draws;
use tumble_planning::collision::{BodyShape, Clearance, CollisionWorld, Contact, EllipsoidWorld, MovingObstacle};
use tumble_planning::dynamics::{AlignedBox, ObstacleEllipsoid, World};
use tumble_planning::laws::{CollisionSample, check_collision_world};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::Vector3;
use tumble_planning::{BodyArc, PlanningError};

type Clear = Result<Clearance, PlanningError>;
type First = Result<Option<Contact>, PlanningError>;

/// A world that answers as the sound one does, but for what a defect changes.
struct Broken {
    sound: EllipsoidWorld,
    clearance: fn(&EllipsoidWorld, &BodyShape, &Pose<f64>, f64) -> Clear,
    first_contact: fn(&EllipsoidWorld, &BodyShape, &BodyArc, f64, f64) -> First,
    lasting_clearance: fn(&EllipsoidWorld, &BodyShape, &Pose<f64>, f64) -> Clear,
    is_still_from: fn(&EllipsoidWorld, f64) -> bool,
    is_round: fn(&EllipsoidWorld, &BodyShape) -> bool,
    reach: f64,
}

impl CollisionWorld for Broken {
    type Body = BodyShape;

    fn clearance(&self, body: &BodyShape, pose: &Pose<f64>, time_s: f64) -> Clear {
        (self.clearance)(&self.sound, body, pose, time_s)
    }

    fn first_contact(&self, body: &BodyShape, arc: &BodyArc, start_s: f64, margin_m: f64) -> First {
        (self.first_contact)(&self.sound, body, arc, start_s, margin_m)
    }

    fn is_still_from(&self, time_s: f64) -> bool {
        (self.is_still_from)(&self.sound, time_s)
    }

    fn is_round(&self, body: &BodyShape) -> bool {
        (self.is_round)(&self.sound, body)
    }

    fn lasting_clearance(&self, body: &BodyShape, pose: &Pose<f64>, from_s: f64) -> Clear {
        (self.lasting_clearance)(&self.sound, body, pose, from_s)
    }

    fn reach_m(&self, body: &BodyShape) -> f64 {
        self.reach * self.sound.reach_m(body)
    }
}

fn sound(is_still: bool) -> Broken {
    let mut draws = Draws::new(3);
    let mut obstacle = || ObstacleEllipsoid {
        world_from_ellipsoid: Pose::from_parts(draws.vector(1.0).into(), draws.attitude()),
        semi_axes: draws.semi_axes(0.6, 5.0),
    };
    let obstacles = vec![obstacle(), obstacle(), obstacle()];
    let keep_in = vec![AlignedBox::between(Vector3::repeat(-3.0), Vector3::repeat(3.0))];
    let world = EllipsoidWorld::new(&World { obstacles, keep_in, keep_out: Vec::new() }).unwrap();
    let passing = MovingObstacle::at_rest(obstacle()).drifting(Vector3::new(0.3, 0.2, -0.1), 0.0).present(-1.0, 2.0);
    Broken {
        sound: if is_still { world } else { world.with_obstacle(passing).unwrap() },
        clearance: EllipsoidWorld::clearance,
        first_contact: EllipsoidWorld::first_contact,
        lasting_clearance: EllipsoidWorld::lasting_clearance,
        is_still_from: EllipsoidWorld::is_still_from,
        is_round: EllipsoidWorld::is_round,
        reach: 1.0,
    }
}

fn samples() -> Vec<CollisionSample> {
    let mut draws = Draws::new(4);
    let sample = |_| CollisionSample { arc: draws.case().arc, start_s: draws.within(-2.0, 2.0), margin_m: 0.02 };
    (0..40).map(sample).collect()
}

/// The law that a world breaks with some body.
fn broken_law(world: &Broken) -> Option<&'static str> {
    let case = std::iter::repeat_with({
        let mut draws = Draws::new(5);
        move || draws.case()
    })
    .find(|case| case.parts.len() == 2 && case.parts[0].semi_axes.min() < case.parts[0].semi_axes.max());
    let body = case.unwrap().body();
    check_collision_world(world, &body, &samples(), 1e-9).err().map(|violation| violation.law)
}

#[test]
fn the_ellipsoid_world_keeps_the_laws() {
    for is_still in [true, false] {
        let world = sound(is_still);
        let mut draws = Draws::new(6);
        for _ in 0..4 {
            let body = draws.case().body();
            check_collision_world(&world, &body, &samples(), 1e-9).unwrap();
        }
    }
}

#[test]
fn defects_of_clearances_are_caught_by_name() {
    let mut world = sound(true);
    world.clearance = |_, _, pose, _| Err(PlanningError::NotFinite { what: "a pose", value: pose.translation.x });
    assert_eq!(broken_law(&world), Some("every query has an answer"));

    let mut world = sound(true);
    world.clearance = |sound, body, pose, time_s| {
        let it = sound.clearance(body, pose, time_s)?;
        Ok(Clearance { distance_m: it.distance_m * 2.0, ..it })
    };
    world.lasting_clearance = world.clearance;
    assert_eq!(broken_law(&world), Some("the clearance changes by no more than the origin moves"));

    let mut world = sound(true);
    world.reach = 0.1;
    assert_eq!(broken_law(&world), Some("the clearance changes by no more than the reach is turned"));

    let mut world = sound(true);
    world.is_round = |_, _| true;
    assert_eq!(broken_law(&world), Some("a round body may turn"));

    // What passes is taken for what lasts.
    let mut world = sound(false);
    world.lasting_clearance = EllipsoidWorld::clearance;
    assert_eq!(broken_law(&world), Some("what lasts is farther than what is there"));
}

#[test]
fn defects_of_first_contacts_are_caught_by_name() {
    // Only the end is looked at.
    let mut world = sound(true);
    world.first_contact = |sound, body, arc, start_s, margin_m| {
        let (end, end_s) = (arc.pose(arc.duration_s), start_s + arc.duration_s);
        let clearance = sound.clearance(body, &end, end_s)?;
        let contact = clearance.nearest.filter(|_| clearance.distance_m < margin_m);
        Ok(contact.map(|blocker| Contact { time_s: arc.duration_s, blocker }))
    };
    assert_eq!(broken_law(&world), Some("nothing is touched before the first contact"));

    // Contacts are announced early.
    let mut world = sound(true);
    world.first_contact = |sound, body, arc, start_s, margin_m| {
        let contact = sound.first_contact(body, arc, start_s, margin_m)?;
        Ok(contact.map(|it| Contact { time_s: 0.99 * it.time_s, ..it }))
    };
    assert_eq!(broken_law(&world), Some("a contact is one"));

    // The obstacles stand where they were when the mission began; the clearance agrees, wrongly.
    let mut world = sound(false);
    world.is_still_from = |_, _| true;
    assert_eq!(broken_law(&world), Some("a later begin changes nothing"));

    // A margin that would be negative is met with open arms.
    let mut world = sound(true);
    world.first_contact = |sound, body, arc, start_s, margin_m| {
        if margin_m > 0.025 { Ok(None) } else { sound.first_contact(body, arc, start_s, margin_m) }
    };
    assert_eq!(broken_law(&world), Some("a wider margin is met no later"));

    // An edge that starts in a contact which it leaves counts as free, its way back does not.
    let mut world = sound(true);
    world.clearance = |_, _, _, _| Ok(Clearance { distance_m: 0.02, nearest: None });
    world.lasting_clearance = world.clearance;
    world.first_contact = |sound, body, arc, start_s, margin_m| {
        let contact = sound.first_contact(body, arc, start_s, margin_m)?;
        Ok(contact.filter(|_| arc.position[1].x > 0.0))
    };
    assert_eq!(broken_law(&world), Some("the way back is as free as the way there"));
    world.first_contact = |sound, body, arc, start_s, margin_m| {
        let contact = sound.first_contact(body, arc, start_s, margin_m)?;
        Ok(contact.map(|it| Contact { time_s: arc.duration_s, ..it }))
    };
    assert_eq!(broken_law(&world), Some("the way back meets what the way there meets"));
}
