//! Mass properties of the robot as its flight software knows them.
//!
//! Provenance: `config/worlds/*.config` and the descriptions of the simulation, nasa/astrobee 0.19.1. There are no
//! tables per robot: every one flies with the entry of its world. Products of inertia are zero there.

use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};

/// A named configuration of robot and carriage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BodyConfiguration {
    /// In the station with four batteries and without payload; weighed on 2019-02-26. The thesis's table 6.4.
    Iss,
    /// On the granite table: robot, carriage, two tanks, two batteries. Only `Izz` was measured.
    Granite,
    /// On the gantry (MGTF): the entry of the station.
    Mgtf,
    /// The robot in NASA's simulation, lighter than what its controller believes.
    Gazebo,
    /// The carriage in NASA's simulation; its `Ixx` and `Iyy` are dummies.
    GazeboCarriage,
}

impl BodyConfiguration {
    /// Every configuration.
    pub const ALL: [Self; 5] = [Self::Iss, Self::Granite, Self::Mgtf, Self::Gazebo, Self::GazeboCarriage];

    /// Its mass properties, body axes.
    pub fn parameters(self) -> InertialParameters<f64> {
        let (mass, center_of_mass, moments) = match self {
            Self::Iss | Self::Mgtf => (
                9.583_788_668,
                [0.003_713_818, -0.000_326_347, -0.002_532_192],
                [0.153_427_995, 0.142_714_05, 0.162_302_759],
            ),
            Self::Granite => (18.9715, [0.0; 3], [0.2517; 3]),
            Self::Gazebo => (9.0877, [0.0; 3], [0.1454, 0.1366, 0.1594]),
            Self::GazeboCarriage => (9.8838, [0.0, 0.0, -0.02], [0.694_860_833, 0.694_860_833, 0.0923]),
        };
        let inertia_about_com = Matrix3::from_diagonal(&Vector3::from(moments));
        InertialParameters::about_com(mass, Vector3::from(center_of_mass), inertia_about_com)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::nalgebra::Vector3;

    #[test]
    fn every_body_can_exist() {
        for configuration in BodyConfiguration::ALL {
            assert!(configuration.parameters().is_strictly_consistent(), "{configuration:?}");
        }
    }

    #[test]
    fn the_granite_entry_is_the_simulated_robot_on_its_carriage() {
        let [granite, robot, carriage] =
            [BodyConfiguration::Granite, BodyConfiguration::Gazebo, BodyConfiguration::GazeboCarriage]
                .map(BodyConfiguration::parameters);
        assert!((granite.mass - robot.mass - carriage.mass).abs() < 1e-12);
        let about_z = |body: &InertialParameters<f64>| body.inertia_about_com()[(2, 2)];
        assert!((about_z(&granite) - about_z(&robot) - about_z(&carriage)).abs() < 1e-12);
    }

    #[test]
    fn the_inertia_of_the_station_is_about_the_centre_of_mass() {
        let iss = BodyConfiguration::Iss.parameters();
        let diagonal = iss.inertia_about_com().diagonal();
        assert!((diagonal - Vector3::new(0.153_427_995, 0.142_714_05, 0.162_302_759)).norm() < 1e-15);
        assert!((iss.center_of_mass().x - 0.003_713_818).abs() < 1e-17);
    }
}
