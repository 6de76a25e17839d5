//! Drag of the robot in the cabin's air, as NASA's simulation has it.

use tumble_dynamics::QuadraticDrag;
use tumble_dynamics::nalgebra::Vector3;

/// Drag coefficient of a cube, face on.
pub const DRAG_COEFFICIENT: f64 = 1.05;
/// Area of a face, m^2 (one square foot).
pub const FACE_AREA_M2: f64 = 0.092_903;
/// Air density of the drag, kg/m^3; the propulsion counts with 1.2.
pub const DRAG_AIR_DENSITY_KG_M3: f64 = 1.225;

/// `F = -1/2 C_d A rho |v| v` at the body origin in still air, and no torque: 0.06 N at 1 m/s, 2 mN at cruise.
///
/// # Source
/// Drag plug-in of nasa/astrobee 0.19.1 (`gazebo_model_plugin_drag`).
pub fn air_drag() -> QuadraticDrag<f64> {
    QuadraticDrag {
        center_of_pressure: Vector3::zeros(),
        force_coefficient: 0.5 * DRAG_COEFFICIENT * FACE_AREA_M2 * DRAG_AIR_DENSITY_KG_M3,
        torque_coefficient: 0.0,
        medium_velocity_world: Vector3::zeros(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::{RigidBodyState, WrenchModel};

    #[test]
    fn drag_is_0_0597_newton_per_squared_velocity_against_it() {
        let mut state = RigidBodyState::at_rest();
        state.twist_body.linear = Vector3::new(0.3, -0.4, 1.2);
        state.twist_body.angular = Vector3::new(1.0, 2.0, 3.0);
        let wrench = air_drag().wrench_body(0.0, &state);
        // |v| = 1.3
        let expected = state.twist_body.linear * -(0.059_748_2 * 1.3);
        assert!((wrench.force - expected).norm() < 1e-7, "{wrench:?}");
        assert!(wrench.torque.norm() < 1e-15);
    }
}
