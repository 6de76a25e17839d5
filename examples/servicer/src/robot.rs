//! The satellite: its body, its actuators, its sensors, and all of it simulated.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_planning::dynamics::{
    DynamicsError, FreeFlyer, InertialParameters, MuntheKaas4, Plant, PulseTiming, PulsedThrusters, ReactionWheel,
    ReactionWheels, RigidBodyState, SimulatedGyrostat, Thruster, ThrusterSet,
};
use tumble_planning::identification::estimator::{Acted, Gauss, Measurement};
use tumble_planning::lie::Wrench;
use tumble_planning::nalgebra::{Matrix3, UnitQuaternion, UnitVector3, Vector3};
use tumble_planning::{ModelBelief, unit_interval};

/// Time between commands.
pub const PERIOD_NS: i64 = 100_000_000;
/// The same, s.
pub const PERIOD_S: f64 = 0.1;
/// Thrust of each of the twelve nozzles, N; two push each way along each axis.
pub const NOZZLE_N: f64 = 5.0;
/// Lever of the nozzles, m.
pub const LEVER_M: f64 = 0.6;
/// What a controller may ask for in any direction, N and N m: less than the nozzles give together.
pub const LIMITS: (f64, f64) = (6.0, 2.0);
/// Radius of a ball around it, m.
pub const RADIUS_M: f64 = 1.1;
/// The star tracker: across its line of sight (body z) and about it, rad.
pub const STARS_RAD: [f64; 2] = [5e-5, 4e-4];
/// The gyroscope, rad/s, and the lidar, m.
pub const GYRO_RAD_S: f64 = 2e-5;
/// See [`GYRO_RAD_S`].
pub const LIDAR_M: f64 = 2e-3;

/// What it really is: 300 kg, the centre of mass beside the origin.
pub fn truth() -> InertialParameters<f64> {
    let cuboid = InertialParameters::solid_box(300.0, [1.2, 1.2, 1.5]);
    InertialParameters::about_com(300.0, Vector3::new(0.03, -0.02, 0.04), cuboid.inertia_about_com())
}

/// What it is taken for before it moves: the fuel in the tanks is not known to better than a fifth of the whole.
pub fn belief() -> ModelBelief {
    ModelBelief::vague(0, InertialParameters::solid_box(250.0, [1.2, 1.2, 1.5]), [0.25, 0.04, 0.3])
}

/// The actuators: wheels turn it until they are full, nozzles do the rest. The pair is an actuator too.
pub type Actuators = (ReactionWheels<4>, PulsedThrusters<12>);

/// Four wheels around a pyramid, and two nozzles at either end of a lever, each way along each axis.
///
/// # Errors
/// None with these numbers.
pub fn actuators() -> Result<Actuators, DynamicsError> {
    let wheel = |x: f64, y: f64| ReactionWheel {
        axis_body: UnitVector3::new_normalize(Vector3::new(x, y, 0.7)),
        largest_torque_n_m: 0.2,
        largest_momentum_n_m_s: 4.0,
    };
    let wheels = ReactionWheels::try_new([wheel(1.0, 0.0), wheel(0.0, 1.0), wheel(-1.0, 0.0), wheel(0.0, -1.0)])?;
    let nozzle = |i: usize| {
        let (axis, end, sense) =
            (i / 4, if i.is_multiple_of(2) { LEVER_M } else { -LEVER_M }, if i % 4 < 2 { 1.0 } else { -1.0 });
        let mut position_body = Vector3::zeros();
        position_body[(axis + 2) % 3] = end;
        let mut direction = Vector3::zeros();
        direction[axis] = sense;
        Thruster { position_body, direction_body: UnitVector3::new_unchecked(direction), largest_thrust_n: NOZZLE_N }
    };
    let thrusters = ThrusterSet::try_new(core::array::from_fn(nozzle))?;
    let timing = PulseTiming { ticks_per_period: 100, shortest_ticks: 2 };
    Ok((wheels, PulsedThrusters { thrusters, timing }))
}

/// What a control period brings: what the satellite knows that it did, and what its sensors say.
pub struct Told {
    /// The wrench and what the wheels hold, as the flight computer knows them.
    pub acted: Acted,
    /// Each sensor in its own time; none of them gives a pose.
    pub measurements: Vec<Measurement>,
}

/// The satellite in simulation: wanted wrenches in, [`Told`] out. A simulator of your own, or the hardware, would stand here.
pub struct Servicer {
    plant: SimulatedGyrostat<FreeFlyer<f64>, MuntheKaas4, Actuators>,
    random: ChaCha8Rng,
    time_ns: i64,
}

impl Servicer {
    /// At this state, wheels at rest.
    ///
    /// # Errors
    /// None with the numbers above.
    pub fn try_new(
        body: InertialParameters<f64>,
        state: RigidBodyState<f64>,
        seed: u64,
    ) -> Result<Self, DynamicsError> {
        let actuation = (actuators()?, Default::default());
        let plant = SimulatedGyrostat::try_new(FreeFlyer::new(body), MuntheKaas4, actuation, state, PERIOD_S)?;
        Ok(Self { plant, random: ChaCha8Rng::seed_from_u64(seed), time_ns: 0 })
    }

    /// The true state, for judges.
    pub fn state(&self) -> &RigidBodyState<f64> {
        self.plant.state()
    }

    /// What the wheels hold now, body axes, N m s.
    pub fn stored_momentum_body(&self) -> Vector3<f64> {
        self.plant.stored_momentum_body()
    }

    /// Normal noise, nearly: the sum of twelve evenly distributed numbers.
    fn noise(&mut self, sigma: Vector3<f64>) -> Vector3<f64> {
        let mut draw = || (0..12).map(|_| unit_interval(&mut self.random)).sum::<f64>() - 6.0;
        Vector3::from_fn(|_, _| draw()).component_mul(&sigma)
    }

    fn measurements(&mut self) -> Vec<Measurement> {
        let (state, stamp_ns) = (*self.plant.state(), self.time_ns);
        let rate = state.twist_body.angular + self.noise(Vector3::repeat(GYRO_RAD_S));
        let rate_body = Some(Gauss::isotropic(rate, GYRO_RAD_S));
        let mut all = vec![Measurement { stamp_ns, rate_body, ..Measurement::default() }];
        if stamp_ns % (2 * PERIOD_NS) == 0 {
            let sigma = Vector3::new(STARS_RAD[0], STARS_RAD[0], STARS_RAD[1]);
            let value = state.world_from_body.rotation * UnitQuaternion::new(self.noise(sigma));
            let covariance = Matrix3::from_diagonal(&sigma.component_mul(&sigma));
            all.push(Measurement { stamp_ns, attitude: Some(Gauss { value, covariance }), ..Measurement::default() });
        }
        if stamp_ns % (5 * PERIOD_NS) == 0 {
            let seen = state.world_from_body.translation.vector + self.noise(Vector3::repeat(LIDAR_M));
            let position_world = Some(Gauss::isotropic(seen, LIDAR_M));
            all.push(Measurement { stamp_ns, position_world, ..Measurement::default() });
        }
        all
    }
}

impl Plant for Servicer {
    /// Wanted wrench, body axes, torque about the body origin.
    type Input = Wrench<f64>;
    type Measurement = Told;
    type Error = DynamicsError;

    fn advance(&mut self, wanted: &Wrench<f64>, duration_s: f64) -> Result<Told, DynamicsError> {
        let (from_ns, before) = (self.time_ns, self.stored_momentum_body());
        let moved = self.plant.advance(wanted, duration_s)?;
        self.time_ns = i64::try_from(moved.time_ns).map_err(|_| DynamicsError::NotFinite)?;
        let acted = Acted {
            from_ns,
            until_ns: self.time_ns,
            wrench_body: moved.realized_wrench_body,
            stored_body: (before + moved.stored_momentum_body) * 0.5,
        };
        Ok(Told { acted, measurements: self.measurements() })
    }
}
