//! Tutorial: your own actuators.
//!
//! Implement [`Actuation`] for your machine, run `check_actuation`, then put it into a simulated body. What has a state
//! of its own implements [`StatefulActuation`] and goes into a simulated gyrostat, which carries the state on.

use tumble_dynamics::laws::{check_actuation, check_momentum_storage, check_total_momentum};
use tumble_dynamics::lie::Wrench;
use tumble_dynamics::nalgebra::{Vector3, Vector6};
use tumble_dynamics::strategies::{draws, wrenches};
use tumble_dynamics::{
    Actuation, DynamicsError, FreeFlyer, InertialParameters, MuntheKaas4, Plant, RigidBodyState, SimulatedBody,
    SimulatedGyrostat, StatefulActuation,
};

/// Six opposed pairs of jets: three pairs push through the origin, three are couples about the axes.
///
/// A jet only pushes, so each component of the wrench uses one jet of its pair.
struct Jets {
    largest_thrust_n: f64,
    lever_m: f64,
}

impl Jets {
    /// Wrench component per thrust.
    fn gains(&self) -> Vector6<f64> {
        let (lever, one) = (2.0 * self.lever_m, 1.0);
        Vector6::new(lever, lever, lever, one, one, one)
    }
}

impl Actuation for Jets {
    /// Thrusts of the twelve jets, N: the pushing and the opposing jet of each pair.
    type Command = [[f64; 2]; 6];

    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<Self::Command, DynamicsError> {
        let wanted = wrench_body.to_vector().component_div(&self.gains());
        if !wanted.iter().all(|thrust| thrust.is_finite()) {
            return Err(DynamicsError::NotFinite);
        }
        let thrust = |wanted: f64| wanted.clamp(0.0, self.largest_thrust_n);
        Ok(core::array::from_fn(|i| [thrust(wanted[i]), thrust(-wanted[i])]))
    }

    fn realize(&self, command: &Self::Command) -> Wrench<f64> {
        // a jet gives what it can, whatever it is told
        let given = |thrust: f64| thrust.clamp(0.0, self.largest_thrust_n);
        let net = Vector6::from_fn(|i, _| given(command[i][0]) - given(command[i][1]));
        net.component_mul(&self.gains()).into()
    }
}

fn jets() -> Jets {
    Jets { largest_thrust_n: 0.3, lever_m: 0.15 }
}

#[test]
fn it_obeys_the_laws() {
    let inside = draws(&wrenches(0.09, 0.3), 1, 200);
    let wanted = draws(&wrenches(1.0, 2.0), 2, 200);
    let commands = [[[0.3, 0.0]; 6], [[9.0, -9.0]; 6], [[0.1, 0.2]; 6]];
    // by how much a limit is exceeded: no jet pulls, none pushes more than it can
    let excess = |command: &[[f64; 2]; 6], _: &Wrench<f64>| {
        let over = |thrust: &f64| (thrust - 0.3).max(-thrust);
        command.as_flattened().iter().map(over).fold(f64::NEG_INFINITY, f64::max)
    };
    check_actuation(&jets(), &inside, &wanted, &commands, &excess, 1e-12).unwrap();
}

#[test]
fn a_simulated_body_reports_what_its_jets_really_gave() {
    let body = FreeFlyer::new(InertialParameters::solid_sphere(3.0, 0.15));
    let mut plant = SimulatedBody::try_new(body, MuntheKaas4, jets(), RigidBodyState::at_rest(), 0.01).unwrap();
    let too_much = Wrench::new(Vector3::zeros(), Vector3::new(1.0, 0.0, -0.1));
    let measured = plant.advance(&too_much, 1.0).unwrap();
    assert!((measured.realized_wrench_body.force - Vector3::new(0.3, 0.0, -0.1)).amax() < 1e-15);
    // v = F t / m
    let velocity = measured.state.twist_body.linear;
    assert!((velocity - Vector3::new(0.1, 0.0, -0.1 / 3.0)).amax() < 1e-12, "{velocity}");
    assert_eq!(measured.time_ns, 1_000_000_000);
}

/// Fluid that motors drive around three loops, one about each axis.
struct FluidLoops {
    largest_momentum_n_m_s: f64,
}

impl StatefulActuation for FluidLoops {
    /// Momentum in each loop, N m s.
    type Inner = Vector3<f64>;
    /// Torque of each motor on its fluid, N m.
    type Command = Vector3<f64>;

    fn allocate_over(
        &self,
        inner: &Self::Inner,
        wanted: &Wrench<f64>,
        hold_s: f64,
    ) -> Result<Vector3<f64>, DynamicsError> {
        if !wanted.to_vector().iter().all(|component| component.is_finite()) {
            return Err(DynamicsError::NotFinite);
        }
        Ok(self.given(inner, &-wanted.torque, hold_s))
    }

    fn realize_over(&self, inner: &Self::Inner, command: &Vector3<f64>, hold_s: f64) -> Wrench<f64> {
        Wrench::new(-self.given(inner, command, hold_s), Vector3::zeros())
    }

    fn advanced(&self, inner: &Self::Inner, command: &Vector3<f64>, hold_s: f64) -> Self::Inner {
        inner + self.given(inner, command, hold_s) * hold_s
    }

    fn stored_momentum_body(&self, inner: &Self::Inner) -> Option<Vector3<f64>> {
        Some(*inner)
    }
}

impl FluidLoops {
    /// What is left of a command when no loop flows faster than it can.
    fn given(&self, inner: &Vector3<f64>, command: &Vector3<f64>, hold_s: f64) -> Vector3<f64> {
        let largest = self.largest_momentum_n_m_s;
        inner.zip_map(command, |stored, torque| {
            let (least, most) = ((-largest - stored) / hold_s, (largest - stored) / hold_s);
            torque.max(least.min(0.0)).min(most.max(0.0))
        })
    }
}

#[test]
fn what_stores_momentum_obeys_the_laws_and_is_carried_on() {
    let loops = FluidLoops { largest_momentum_n_m_s: 0.05 };
    let excess = |inner: &Vector3<f64>| inner.amax() - 0.05;
    let wanted = draws(&wrenches(0.02, 1.0), 3, 100);
    let starts = [Vector3::zeros(), Vector3::new(0.05, -0.05, 0.01)];
    check_momentum_storage(&loops, &starts, &wanted, 0.5, &excess, 1e-12).unwrap();

    let body = InertialParameters::solid_box(3.0, [0.3, 0.2, 0.1]);
    let mut start = RigidBodyState::at_rest();
    start.twist_body.angular = Vector3::new(0.4, -0.2, 0.3);
    let actuation = (loops, Vector3::zeros());
    let mut plant = SimulatedGyrostat::try_new(FreeFlyer::new(body), MuntheKaas4, actuation, start, 0.01).unwrap();
    check_total_momentum(&mut plant, &body, &wanted, 0.5, 1e-6).unwrap();
}
