//! The robots that the program knows.

#[cfg(feature = "astrobee")]
mod astrobee;

use crate::{space_cobot, spheres};
use tumble_dynamics::{PulseTrain, StatefulDrive};
use tumble_formats::{ActuatorPreset, BodyPreset, Robot, Robots};

/// Space CoBot; see [`space_cobot`].
struct SpaceCobot;

impl Robot for SpaceCobot {
    fn name(&self) -> &'static str {
        "space-cobot"
    }

    fn sentence(&self) -> &'static str {
        "a free-flyer with six tilted rotors"
    }

    fn bodies(&self) -> Vec<BodyPreset> {
        vec![BodyPreset { name: "space-cobot", body: space_cobot::body() }]
    }

    fn actuators(&self) -> Vec<ActuatorPreset> {
        vec![ActuatorPreset {
            name: "space-cobot",
            sentence: "six rotors",
            make: || Ok(Box::new(StatefulDrive::new(space_cobot::rotors()?, ()))),
            thrusters: space_cobot::erring_rotors,
        }]
    }
}

/// A SPHERES-class satellite; see [`spheres`].
struct Spheres;

impl Robot for Spheres {
    fn name(&self) -> &'static str {
        "spheres"
    }

    fn sentence(&self) -> &'static str {
        "a satellite with twelve pulsed thrusters"
    }

    fn bodies(&self) -> Vec<BodyPreset> {
        vec![BodyPreset { name: "spheres", body: spheres::body() }]
    }

    fn actuators(&self) -> Vec<ActuatorPreset> {
        vec![ActuatorPreset {
            name: "spheres",
            sentence: "twelve pulsed thrusters",
            make: || Ok(Box::new(PulseTrain::new(spheres::thrusters()?, spheres::TICKS_PER_FLIGHT_STEP))),
            thrusters: spheres::erring_thrusters,
        }]
    }
}

/// Astrobee (feature `astrobee`), Space CoBot and SPHERES.
pub fn shipped() -> Robots {
    let robots = Robots::none();
    #[cfg(feature = "astrobee")]
    let robots = robots.with(astrobee::Astrobee);
    robots.with(SpaceCobot).with(Spheres)
}
