//! Where the robot flies: the station, the granite table, the gantry; their volumes, obstacle sets, points and bodies.
//!
//! World axes: right-handed, z points **down**, towards the deck.

mod granite;
mod iss;
mod listed;

pub use listed::NamedPose;

use crate::bodies::BodyConfiguration;
use crate::flight_modes::FlightSite;
use listed::Listed;
use tumble_dynamics::nalgebra::{Translation3, Vector3};
use tumble_dynamics::{AlignedBox, InertialParameters, ObstacleEllipsoid, World};
use tumble_lie::Pose;

/// A place with its volumes and its body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum WorldPreset {
    /// The International Space Station.
    #[default]
    Iss,
    /// The granite table on the ground: three degrees of freedom, the robot on its air-bearing carriage.
    Granite,
    /// The gantry on the ground: six degrees of freedom; its volume is not published, so nothing bounds it.
    Mgtf,
    /// Nothing around.
    Open,
}

/// How many obstacle sets each place has.
///
/// # Source
/// rattle-iros-2022: 0 default, 1 the full runs, 2 the comparison of weightings, 3 none, 4 is 1 and an astronaut.
pub const OBSTACLE_SETS: u8 = 5;

/// Radius of the sphere that stands for the robot, m.
///
/// # Source
/// rattle-iros-2022, global planner. NASA's mapper uses 0.28 m, the sphere around the whole cube.
pub const ROBOT_RADIUS_M: f64 = 0.15;

/// Acceleration of free fall on the ground, m/s^2.
pub const GRAVITY_M_S2: f64 = 9.80665;

impl WorldPreset {
    /// All places.
    pub const ALL: [Self; 4] = [Self::Iss, Self::Granite, Self::Mgtf, Self::Open];

    /// The place with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|preset| preset.name() == name)
    }

    /// Name in scenarios.
    pub fn name(self) -> &'static str {
        match self {
            Self::Iss => "iss",
            Self::Granite => "granite",
            Self::Mgtf => "mgtf",
            Self::Open => "open",
        }
    }

    /// Whether the body moves in x, y and yaw only.
    pub fn is_planar(self) -> bool {
        self == Self::Granite
    }

    /// Half the edge of the square table that the carriage floats on, centred at the world's origin, m.
    pub fn table_half_width_m(self) -> Option<f64> {
        (self == Self::Granite).then_some(granite::TABLE_HALF_WIDTH_M)
    }

    /// Keep-in and keep-out boxes without obstacles.
    pub fn volumes(self) -> World {
        let boxes = |list: &[[f64; 6]]| list.iter().map(corners).collect();
        match self {
            Self::Iss => {
                World { keep_in: boxes(&iss::KEEP_IN), keep_out: boxes(&iss::KEEP_OUT), obstacles: Vec::new() }
            }
            Self::Granite => World { keep_in: boxes(&[granite::KEEP_IN]), ..World::default() },
            Self::Mgtf | Self::Open => World::default(),
        }
    }

    /// One of the obstacle sets; `None` for a number that is no set. The gantry and open space have empty sets.
    pub fn obstacles(self, set: u8) -> Option<Vec<ObstacleEllipsoid>> {
        let (first, more): (&[Listed], &[Listed]) = match (self, set) {
            (_, OBSTACLE_SETS..) => return None,
            (Self::Iss, 0) => (&iss::DEFAULT_OBSTACLES, &[]),
            (Self::Iss, 1) => (&iss::SLALOM, &[]),
            (Self::Iss, 2) => (&iss::LETTERS, &[]),
            (Self::Iss, 4) => (&iss::SLALOM, &iss::ASTRONAUT),
            (Self::Granite, 0) => (&granite::DEFAULT_OBSTACLES, &[]),
            (Self::Granite, 1) => (&granite::ROOM, &[]),
            (Self::Granite, 2) => (&granite::WALLS, &[]),
            (Self::Granite, 4) => (&granite::ROOM, &granite::ASTRONAUT),
            _ => (&[], &[]),
        };
        Some(first.iter().chain(more).map(ellipsoid).collect())
    }

    /// Named poses: the points of the RATTLE runs, berths and berth approaches, start poses.
    pub fn poses(self) -> &'static [NamedPose] {
        match self {
            Self::Iss => &iss::POSES,
            Self::Granite => &granite::POSES,
            Self::Mgtf | Self::Open => &[],
        }
    }

    /// The pose with this name.
    pub fn pose(self, name: &str) -> Option<Pose<f64>> {
        self.poses().iter().find(|pose| pose.name == name).map(NamedPose::world_from_body)
    }

    /// The robot as this place's configuration knows it.
    pub fn body(self) -> InertialParameters<f64> {
        match self {
            Self::Iss | Self::Open => BodyConfiguration::Iss,
            Self::Granite => BodyConfiguration::Granite,
            Self::Mgtf => BodyConfiguration::Mgtf,
        }
        .parameters()
    }

    /// Whose gains and limits the flight software uses here.
    pub fn site(self) -> FlightSite {
        match self {
            Self::Iss | Self::Open => FlightSite::Iss,
            Self::Granite => FlightSite::Granite,
            Self::Mgtf => FlightSite::Mgtf,
        }
    }

    /// Acceleration of free fall, world axes, m/s^2.
    ///
    /// # Source
    /// `astrobee/config/worlds/*.config`; z points down.
    pub fn gravity_m_s2(self) -> [f64; 3] {
        match self {
            Self::Iss | Self::Open => [0.0; 3],
            Self::Granite | Self::Mgtf => [0.0, 0.0, GRAVITY_M_S2],
        }
    }
}

fn corners(&[x1, y1, z1, x2, y2, z2]: &[f64; 6]) -> AlignedBox {
    AlignedBox::between(Vector3::new(x1, y1, z1), Vector3::new(x2, y2, z2))
}

fn ellipsoid(&(semi_axes, center): &Listed) -> ObstacleEllipsoid {
    ObstacleEllipsoid {
        world_from_ellipsoid: Translation3::from(Vector3::from(center)).into(),
        semi_axes: Vector3::from(semi_axes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::Surroundings;

    fn volume(b: &AlignedBox) -> f64 {
        (b.upper_world - b.lower_world).product()
    }

    #[test]
    fn corners_are_in_order_whatever_the_file_says() {
        for preset in WorldPreset::ALL {
            let world = preset.volumes();
            for b in world.keep_in.iter().chain(&world.keep_out) {
                assert!((b.upper_world - b.lower_world).min() > 0.0, "{preset:?} {b:?}");
            }
        }
        // The first keep-out box of the file has its x corners the other way round.
        let first = WorldPreset::Iss.volumes().keep_out[0];
        assert!((first.lower_world.x - 11.8722).abs() < 1e-12 && (first.upper_world.x - 12.3539).abs() < 1e-12);
    }

    #[test]
    fn the_japanese_module_has_its_size() {
        let world = WorldPreset::Iss.volumes();
        assert_eq!((world.keep_in.len(), world.keep_out.len()), (26, 4));
        let jem = world.keep_in[6];
        assert!((jem.upper_world - jem.lower_world - Vector3::new(2.136, 6.483, 2.135)).amax() < 5e-4);
        assert!((volume(&jem) - 29.554).abs() < 0.02, "{}", volume(&jem));
        // Module, its end, hatch and node 2 hang together: each touches or overlaps the next.
        for (a, b) in [(7, 6), (6, 5), (5, 18), (18, 16)] {
            let (a, b) = (world.keep_in[a], world.keep_in[b]);
            let overlap = a.upper_world.inf(&b.upper_world) - a.lower_world.sup(&b.lower_world);
            assert!(overlap.min() > -1e-6, "{overlap}");
        }
        let total: f64 = world.keep_in.iter().map(volume).sum();
        assert!((150.0..300.0).contains(&total), "{total}");
    }

    #[test]
    fn the_points_of_the_runs_are_inside_and_clear_of_the_obstacles_of_the_runs() {
        let mut blocked = Vec::new();
        for preset in [WorldPreset::Iss, WorldPreset::Granite] {
            for set in 0..OBSTACLE_SETS {
                let world = World { obstacles: preset.obstacles(set).unwrap(), ..preset.volumes() };
                for name in ["A", "B", "C"] {
                    let at = preset.pose(name).unwrap().translation.vector;
                    let around = Surroundings::of(&world, preset.table_half_width_m(), &at, ROBOT_RADIUS_M);
                    blocked.extend(around.obstacle.map(|index| (preset.name(), set, name, index)));
                    assert_eq!(Surroundings { obstacle: None, ..around }, Surroundings::default(), "{preset:?} {name}");
                }
            }
            assert!(preset.obstacles(OBSTACLE_SETS).is_none());
        }
        // As published: points of other runs than those of the set. The full runs (set 1) are clear.
        assert_eq!(blocked, [("granite", 0, "B", 1), ("granite", 2, "C", 1), ("granite", 4, "C", 4)]);
        let counts = |preset: WorldPreset| [0, 1, 2, 3, 4].map(|set| preset.obstacles(set).unwrap().len());
        assert_eq!(counts(WorldPreset::Iss), [3, 2, 10, 0, 3]);
        assert_eq!(counts(WorldPreset::Granite), [3, 4, 2, 0, 5]);
    }

    #[test]
    fn every_named_pose_is_inside_and_upright_on_the_table() {
        for preset in WorldPreset::ALL {
            for pose in preset.poses() {
                let found = pose.world_from_body();
                let around = Surroundings::of(
                    &World { keep_out: Vec::new(), ..preset.volumes() },
                    None,
                    &found.translation.vector,
                    0.0,
                );
                assert!(!around.outside_keep_in, "{preset:?} {}", pose.name);
                assert!((found.rotation.norm() - 1.0).abs() < 1e-15);
                assert!(!preset.is_planar() || (found.rotation.i == 0.0 && found.rotation.j == 0.0));
            }
        }
    }

    #[test]
    fn names_are_found_again() {
        for preset in WorldPreset::ALL {
            assert_eq!(WorldPreset::from_name(preset.name()), Some(preset));
        }
        assert_eq!(WorldPreset::from_name("moon"), None);
    }
}
