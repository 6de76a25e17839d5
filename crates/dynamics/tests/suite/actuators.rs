//! Thrusters, rotors and reaction wheels: goldens by hand, laws, and defects that the laws must name.

use tumble_dynamics::laws::{
    Held, LawViolation, check_actuation, check_momentum_storage, check_stateful_actuation, check_total_momentum,
};
use tumble_dynamics::lie::{Twist, Wrench};
use tumble_dynamics::nalgebra::{Matrix3, Matrix6, SVector, UnitVector3, Vector3, Vector6};
use tumble_dynamics::strategies::{draws, vectors, wrenches};
use tumble_dynamics::{
    Actuation, DynamicsError, FreeFlyer, InertialParameters, MuntheKaas4, Plant, PulseTiming, PulsedThrusters,
    ReactionWheel, ReactionWheels, RigidBodyState, Rotor, RotorSet, SimulatedGyrostat, StatefulActuation, Thruster,
    ThrusterSet, kinetic_energy,
};

type State<const N: usize> = SVector<f64, N>;

/// Two parallel thrusters at either end of a lever, each way along each axis.
fn pairs(thrust: f64, lever: f64) -> [Thruster; 12] {
    core::array::from_fn(|i| {
        let (axis, end, sense) = (i / 4, if i % 2 == 0 { 1.0 } else { -1.0 }, if i % 4 < 2 { 1.0 } else { -1.0 });
        let mut place = Vector3::zeros();
        place[(axis + 2) % 3] = end * lever;
        let mut direction = Vector3::zeros();
        direction[axis] = sense;
        Thruster {
            position_body: place,
            direction_body: UnitVector3::new_unchecked(direction),
            largest_thrust_n: thrust,
        }
    })
}

/// The same with every place, direction and thrust a little off, so that nothing is symmetric.
fn skew_thrusters() -> [Thruster; 12] {
    let mut errors = draws(&[vectors(0.03), vectors(0.3)], 9, 12).into_iter();
    pairs(0.112, 0.0965).map(|Thruster { position_body, direction_body, largest_thrust_n }| {
        let [place, direction] = errors.next().unwrap();
        Thruster {
            position_body: position_body + place,
            direction_body: UnitVector3::new_normalize(direction_body.into_inner() + direction),
            largest_thrust_n: largest_thrust_n * (1.0 + direction.x),
        }
    })
}

/// By how much thrusts exceed their limits.
fn thrust_excess<const N: usize>(set: &ThrusterSet<N>, thrusts: &SVector<f64, N>) -> f64 {
    let over = |(thrust, thruster): (&f64, &Thruster)| (thrust - thruster.largest_thrust_n).max(-thrust);
    thrusts.iter().zip(set.thrusters()).map(over).fold(f64::NEG_INFINITY, f64::max)
}

/// Wrenches that a machine gives for random openings: inside its limits, most of them nowhere near zero.
fn given<const N: usize>(set: &ThrusterSet<N>, seed: u64, count: usize) -> Vec<Wrench<f64>> {
    let openings = proptest::collection::vec(0.0..1.0, N);
    let thrusts = |part: Vec<f64>| SVector::<f64, N>::from_fn(|i, _| part[i] * set.thrusters()[i].largest_thrust_n);
    draws(&openings, seed, count).into_iter().map(|part| set.realize(&thrusts(part))).collect()
}

fn check_thrusters<const N: usize, A: Actuation<Command = State<N>>>(
    set: &ThrusterSet<N>,
    actuation: &A,
) -> Result<(), LawViolation> {
    let one_side = State::<N>::from_fn(|i, _| if i % 4 < 2 { 9.0 } else { -9.0 });
    let commands = [State::repeat(0.1), State::repeat(9.0), one_side, State::repeat(f64::NAN)];
    let excess = |command: &State<N>, realized: &Wrench<f64>| {
        let reach: f64 = set.thrusters().iter().map(|thruster| thruster.largest_thrust_n).sum();
        thrust_excess(set, command).max(realized.force.norm() - reach)
    };
    check_actuation(actuation, &given(set, 1, 300), &draws(&wrenches(1.0, 3.0), 2, 300), &commands, &excess, 1e-12)
}

#[test]
fn thrusters_obey_the_laws() {
    let set = ThrusterSet::try_new(pairs(0.112, 0.0965)).unwrap();
    check_thrusters(&set, &set).unwrap();
    let set = ThrusterSet::try_new(skew_thrusters()).unwrap();
    check_thrusters(&set, &set).unwrap();
}

/// The least total thrust by brute force: some optimum has all but six thrusters at a limit.
fn least_thrust_of_vertices(set: &ThrusterSet<12>, wanted: &Wrench<f64>) -> f64 {
    let columns = set.thrusters().map(|thruster| thruster.wrench_body().to_vector());
    let thrust = |i: &usize| set.thrusters()[*i].largest_thrust_n;
    let mut least = f64::INFINITY;
    for chosen in (0..1_u32 << 12).filter(|chosen| chosen.count_ones() == 6) {
        let (basis, limited): (Vec<usize>, Vec<usize>) = (0..12).partition(|i| chosen >> i & 1 == 1);
        let Some(inverse) = Matrix6::from_fn(|row, i| columns[basis[i]][row]).try_inverse() else { continue };
        let free = inverse * wanted.to_vector();
        let taken: Vec<_> = limited.iter().map(|i| inverse * columns[*i]).collect();
        for full in 0..1_u32 << 6 {
            let open = |i: &usize| full >> i & 1 == 1;
            let openings = (0..6).filter(open).fold(free, |rest, i| rest - taken[i]);
            if openings.iter().all(|part| (-1e-9..=1.0 + 1e-9).contains(part)) {
                let partly: f64 = basis.iter().zip(&openings).map(|(i, part)| part * thrust(i)).sum();
                let fully: f64 = (0..6).filter(open).map(|i| thrust(&limited[i])).sum();
                least = least.min(partly + fully);
            }
        }
    }
    least
}

#[test]
fn no_other_sharing_takes_less_thrust() {
    let set = ThrusterSet::try_new(skew_thrusters()).unwrap();
    for wanted in given(&set, 3, 20) {
        let total = set.allocate(&wanted).unwrap().sum();
        let least = least_thrust_of_vertices(&set, &wanted);
        assert!((total - least).abs() < 1e-8, "{total} against {least}");
    }
}

#[test]
fn a_saturated_wrench_keeps_its_direction_and_cannot_grow() {
    let set = ThrusterSet::try_new(skew_thrusters()).unwrap();
    for (count, wanted) in draws(&wrenches(0.02, 0.2), 4, 300).into_iter().enumerate() {
        let realized = set.realize(&set.allocate(&wanted).unwrap()).to_vector();
        let wanted = wanted.to_vector();
        let part = realized.dot(&wanted) / wanted.norm_squared();
        assert!(
            (0.0..=1.0 + 1e-12).contains(&part) && (realized - wanted * part).amax() < 1e-12,
            "{realized} {wanted}"
        );
        if part < 1.0 - 1e-6 {
            let larger = Wrench::from(wanted * (part * 1.001));
            let again = set.realize(&set.allocate(&larger).unwrap()).to_vector();
            assert!((again - realized).amax() < 1e-10);
            assert!(count > 30 || least_thrust_of_vertices(&set, &larger).is_infinite(), "{part} could grow");
        }
    }
}

#[test]
fn thrusters_by_hand() {
    // two thrusters of 1 N along x, 0.5 m either side: 1.5 N and 0.25 N m need 1 N and 0.5 N
    let set = ThrusterSet::try_new(pairs(1.0, 0.5)).unwrap();
    let wanted = Wrench::new(Vector3::new(0.0, 0.25, 0.0), Vector3::new(1.5, 0.0, 0.0));
    let thrusts = set.allocate(&wanted).unwrap();
    let expected = SVector::<f64, 12>::from_fn(|i, _| [1.0, 0.5].get(i).copied().unwrap_or(0.0));
    assert!((thrusts - expected).amax() < 1e-15, "{thrusts}");
    // asked for twice as much, it gives the half of it
    let thrusts = set.allocate(&(wanted * 2.0)).unwrap();
    assert!((thrusts - expected).amax() < 1e-15, "{thrusts}");
    for size in [0.0, 5e-324, 1e-300, 1e300] {
        let wanted = Wrench::new(Vector3::new(0.0, size, -size), Vector3::new(size, 0.0, size));
        let realized = set.realize(&set.allocate(&wanted).unwrap());
        assert!(realized.to_vector().iter().all(|component| component.is_finite()), "{realized:?}");
    }
}

#[test]
fn pulses_by_hand() {
    let thrusters = ThrusterSet::try_new(pairs(1.0, 0.5)).unwrap();
    let valves = PulsedThrusters { thrusters, timing: PulseTiming { ticks_per_period: 100, shortest_ticks: 10 } };
    let pulse = |thrust: f64| {
        let couple = Wrench::new(Vector3::new(0.0, thrust / 2.0, 0.0), Vector3::new(thrust, 0.0, 0.0));
        let command = valves.allocate(&couple).unwrap();
        assert!(command[1..].iter().all(|ticks| *ticks == 0), "{command:?}");
        command[0]
    };
    assert_eq!([0.004, 0.044, 0.05, 0.099, 0.104, 0.106, 0.987, 2.0].map(pulse), [0, 0, 10, 10, 10, 11, 99, 100]);
    // a valve told more than a period is open all the time; told less than it can, it stays closed
    let mut command = [0; 12];
    (command[0], command[4]) = (1000, 4);
    assert!((valves.realize(&command) - Wrench::new(Vector3::y() * 0.5, Vector3::x())).to_vector().amax() < 1e-15);
}

#[test]
fn thrusters_that_cannot_are_refused() {
    let mut weak = pairs(1.0, 0.5);
    weak[3].largest_thrust_n = 0.0;
    assert_eq!(ThrusterSet::try_new(weak), Err(DynamicsError::InvalidActuator { index: 3 }));
    weak[3].largest_thrust_n = f64::NAN;
    assert_eq!(ThrusterSet::try_new(weak), Err(DynamicsError::InvalidActuator { index: 3 }));
    // no lever, no torque
    assert_eq!(ThrusterSet::try_new(pairs(1.0, 0.0)), Err(DynamicsError::OutOfReach { component: 0 }));
    // full rank, but all push the same way along z
    let mut one_way = pairs(1.0, 0.5);
    for thruster in &mut one_way[8..] {
        thruster.direction_body = Vector3::z_axis();
    }
    assert!(matches!(ThrusterSet::try_new(one_way), Err(DynamicsError::OutOfReach { .. })));
}

/// Six rotors around the z axis, tilted to alternate sides.
fn tilted_rotors() -> [Rotor; 6] {
    core::array::from_fn(|i| {
        let (angle, side) = (i as f64 * core::f64::consts::FRAC_PI_3, if i % 2 == 0 { 1.0 } else { -1.0 });
        let (radial, tangent) =
            (Vector3::new(angle.cos(), angle.sin(), 0.0), Vector3::new(-angle.sin(), angle.cos(), 0.0));
        Rotor {
            position_body: radial * 0.2,
            axis_body: UnitVector3::new_normalize(tangent * (0.8 * side) + Vector3::z() * 0.6),
            thrust_coefficient: 1e-6,
            drag_coefficient: 1e-8 * side,
            largest_speed_rad_s: 1500.0,
        }
    })
}

fn check_rotors<A: Actuation<Command = Vector6<f64>>>(actuation: &A) -> Result<(), LawViolation> {
    let speeds = |speeds: [Vector3<f64>; 2]| Vector6::from_fn(|i, _| speeds[i / 3][i % 3]);
    let rotors = RotorSet::try_new(tilted_rotors()).unwrap();
    let inside: Vec<_> =
        draws(&[vectors(1500.0), vectors(1500.0)], 5, 300).into_iter().map(|s| rotors.realize(&speeds(s))).collect();
    let commands = [Vector6::repeat(800.0), Vector6::repeat(-9e9), Vector6::repeat(f64::NAN)];
    let excess = |speeds: &Vector6<f64>, realized: &Wrench<f64>| {
        // six rotors of 2.25 N
        (speeds.amax() / 1500.0 - 1.0).max(realized.force.norm() - 13.5)
    };
    check_actuation(actuation, &inside, &draws(&wrenches(10.0, 60.0), 6, 300), &commands, &excess, 1e-12)
}

#[test]
fn rotors_obey_the_laws() {
    check_rotors(&RotorSet::try_new(tilted_rotors()).unwrap()).unwrap();
}

#[test]
fn rotors_by_hand() {
    let rotors = RotorSet::try_new(tilted_rotors()).unwrap();
    // rotor 0 at 1000 rad/s: 1 N along (0, 0.8, 0.6) at (0.2, 0, 0), drag 0.01 N m along it
    let wrench = rotors.realize(&Vector6::new(1000.0, 0.0, 0.0, 0.0, 0.0, 0.0));
    assert!((wrench.force - Vector3::new(0.0, 0.8, 0.6)).amax() < 1e-15);
    assert!((wrench.torque - Vector3::new(0.0, -0.12 + 0.008, 0.16 + 0.006)).amax() < 1e-15);
    // 3.6 N along z: each 1 N, 1000 rad/s; ten times as much: the limit of each
    let up = |force: f64| rotors.allocate(&Wrench::new(Vector3::zeros(), Vector3::z() * force)).unwrap();
    assert!((up(3.6) - Vector6::repeat(1000.0)).amax() < 1e-9, "{}", up(3.6));
    assert!((up(-36.0) + Vector6::repeat(1500.0)).amax() < 1e-9, "{}", up(-36.0));
    let upright = tilted_rotors().map(|rotor| Rotor { axis_body: Vector3::z_axis(), ..rotor });
    assert_eq!(RotorSet::try_new(upright), Err(DynamicsError::OutOfReach { component: 3 }));
}

/// Four wheels on the faces of a pyramid.
fn pyramid() -> ReactionWheels<4> {
    let wheel = |x: f64, y: f64| ReactionWheel {
        axis_body: UnitVector3::new_normalize(Vector3::new(x, y, 1.0)),
        largest_torque_n_m: 0.02,
        largest_momentum_n_m_s: 0.1,
    };
    ReactionWheels::try_new([wheel(1.0, 0.0), wheel(0.0, 1.0), wheel(-1.0, 0.0), wheel(0.0, -1.0)]).unwrap()
}

/// Commands are held for half a second.
fn check_wheels<A: StatefulActuation<Inner = State<4>, Command = State<4>>>(
    actuation: &A,
    momentum: &State<4>,
    inside_torque: f64,
) -> Result<(), LawViolation> {
    // wheels have no force to give: the wrenches inside their limits are torques
    let inside = draws(&wrenches(inside_torque, 0.0), 7, 300);
    let commands = [State::<4>::repeat(0.01), State::repeat(-1.0), State::repeat(f64::NAN)];
    let excess = |torques: &State<4>, realized: &Wrench<f64>| {
        let spun_up = (momentum + torques * 0.5).amax() - 0.1;
        (torques.amax() - 0.02).max(spun_up).max(realized.torque.norm() - 0.08).max(realized.force.norm())
    };
    let held = Held { actuation, inner: momentum, hold_s: 0.5 };
    check_stateful_actuation(&held, &inside, &draws(&wrenches(1.0, 1.0), 8, 300), &commands, &excess, 1e-14)
}

#[test]
fn reaction_wheels_obey_the_laws() {
    let wheels = pyramid();
    let mut momentum = State::<4>::zeros();
    check_wheels(&wheels, &momentum, 0.01).unwrap();
    // wheel 0 at 0.098 of its 0.1 N m s: it can take 0.004 N m more for half a second
    momentum = wheels.advanced(&momentum, &State::<4>::from_column_slice(&[0.02, 0.0, 0.0, -0.02]), 0.5);
    for torque in [0.02, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02, 0.016] {
        momentum = wheels.advanced(&momentum, &State::<4>::from_column_slice(&[torque, 0.0, 0.0, -torque]), 0.5);
    }
    assert!((momentum[0] - 0.098).abs() < 1e-15);
    check_wheels(&wheels, &momentum, 0.001).unwrap();
    for _ in 0..30 {
        momentum = wheels.advanced(&momentum, &State::<4>::repeat(1.0), 0.5);
        assert!(momentum.amax() <= 0.1);
    }
    assert!((momentum - State::<4>::repeat(0.1)).amax() < 1e-9);
    // spun up, they can only be slowed: none of this torque, all of its opposite
    let about_z = |torque: f64| {
        let wanted = Wrench::new(Vector3::z() * torque, Vector3::zeros());
        wheels.realize_over(&momentum, &wheels.allocate_over(&momentum, &wanted, 0.5).unwrap(), 0.5)
    };
    assert!(about_z(-0.02).torque.norm() < 1e-12);
    assert!((about_z(0.02).torque - Vector3::z() * 0.02).amax() < 1e-15);
    check_storage(&wheels).unwrap();
}

/// From rest and from near a limit, for half a second each.
fn check_storage<A: StatefulActuation<Inner = State<4>>>(actuation: &A) -> Result<(), LawViolation> {
    let starts = [State::zeros(), State::from_column_slice(&[0.098, 0.0, -0.05, 0.1])];
    let wanted: Vec<_> = draws(&wrenches(0.05, 1.0), 12, 200);
    check_momentum_storage(actuation, &starts, &wanted, 0.5, &|momentum| momentum.amax() - 0.1, 1e-13)
}

#[test]
fn reaction_wheels_by_hand() {
    let axis = |axis_body| ReactionWheel { axis_body, largest_torque_n_m: 0.5, largest_momentum_n_m_s: 2.0 };
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let wheels = ReactionWheels::try_new(axes.map(axis)).unwrap();
    let wanted = Wrench::new(Vector3::new(0.1, -0.2, 0.3), Vector3::x());
    let command = wheels.allocate_over(&Vector3::zeros(), &wanted, 1.0).unwrap();
    assert!((command - Vector3::new(-0.1, 0.2, -0.3)).amax() < 1e-15);
    assert_eq!(wheels.realize_over(&Vector3::zeros(), &command, 1.0).force, Vector3::zeros());
    let momentum = wheels.advanced(&Vector3::zeros(), &command, 1.0);
    // h x w: (-0.1, 0.2, -0.3) x (0, 0, 2) = (0.4, 0.2, 0); it does no work
    let rate = Vector3::z() * 2.0;
    let torque = wheels.gyroscopic_torque(&momentum, &rate);
    assert!((torque - Vector3::new(0.4, 0.2, 0.0)).amax() < 1e-15 && torque.dot(&rate).abs() < 1e-15);
    // the body takes the opposite of what the wheels take
    assert!((wheels.stored_momentum_body(&momentum).unwrap() + wanted.torque).amax() < 1e-15);
    let flat = [Vector3::x_axis(), Vector3::y_axis(), Vector3::x_axis()];
    assert_eq!(ReactionWheels::try_new(flat.map(axis)), Err(DynamicsError::OutOfReach { component: 2 }));
    let weak = [axis(axes[0]), ReactionWheel { largest_momentum_n_m_s: -1.0, ..axis(axes[1]) }, axis(axes[2])];
    assert_eq!(ReactionWheels::try_new(weak), Err(DynamicsError::InvalidActuator { index: 1 }));
}

fn satellite() -> InertialParameters<f64> {
    let inertia = Matrix3::new(0.9, 0.05, -0.1, 0.05, 1.2, 0.02, -0.1, 0.02, 0.7);
    InertialParameters::about_com(12.0, Vector3::new(0.03, -0.05, 0.02), inertia)
}

/// A satellite that tumbles at a third of a radian per second, its wheels spinning already.
fn tumbling<A: StatefulActuation>(actuation: (A, A::Inner)) -> SimulatedGyrostat<FreeFlyer<f64>, MuntheKaas4, A> {
    let mut state = RigidBodyState::at_rest();
    state.twist_body = Twist::new(Vector3::new(0.2, -0.1, 0.25), Vector3::new(0.05, 0.02, -0.03));
    SimulatedGyrostat::try_new(FreeFlyer::new(satellite()), MuntheKaas4, actuation, state, 0.02).unwrap()
}

fn check_plant<A: StatefulActuation>(actuation: (A, A::Inner)) -> Result<(), LawViolation> {
    let wanted = draws(&wrenches(0.03, 0.5), 13, 200);
    check_total_momentum(&mut tumbling(actuation), &satellite(), &wanted, 0.5, 1e-9)
}

#[test]
fn a_body_with_wheels_keeps_its_momentum_and_precesses() {
    let momentum = State::<4>::from_column_slice(&[0.05, -0.02, 0.08, 0.0]);
    check_plant((pyramid(), momentum)).unwrap();
    // motors at rest: what is stored does no work, so that the energy of the body is kept
    let energy = |state: &RigidBodyState<f64>| kinetic_energy(&satellite(), &state.twist_body);
    let mut plant = tumbling((pyramid(), momentum));
    let before = energy(plant.state());
    for _ in 0..200 {
        plant.advance(&Wrench::zero(), 0.5).unwrap();
    }
    assert_eq!(plant.inner(), &momentum);
    assert!((energy(plant.state()) / before - 1.0).abs() < 1e-9, "{}", energy(plant.state()) / before);
    // and what the motors do is what the body gains: integral of torque times rate, by Simpson in short holds
    let (mut plant, mut gained, start) = (tumbling((pyramid(), momentum)), 0.0, before);
    let push = Wrench::new(Vector3::new(0.004, -0.006, 0.005), Vector3::zeros());
    for _ in 0..500 {
        let mut halfway = plant;
        let rates = [plant.state().twist_body.angular, {
            halfway.advance(&push, 0.01).unwrap();
            halfway.state().twist_body.angular
        }];
        let measured = plant.advance(&push, 0.02).unwrap();
        let torque = measured.realized_wrench_body.torque;
        gained += torque.dot(&(rates[0] + rates[1] * 4.0 + measured.state.twist_body.angular)) * 0.02 / 6.0;
    }
    let gain = energy(plant.state()) - start;
    assert!(gain.abs() > 1e-3 && (gain - gained).abs() < 1e-9 * gain.abs(), "{gain} {gained}");
}

#[test]
fn a_servicer_turns_by_wheels_and_pushes_by_nozzles() {
    let nozzles = ThrusterSet::try_new(pairs(0.112, 0.0965)).unwrap();
    let mut plant = tumbling(((pyramid(), nozzles), (State::<4>::zeros(), ())));
    let wanted = Wrench::new(Vector3::new(0.003, 0.002, -0.004), Vector3::new(0.05, 0.0, 0.02));
    let measured = plant.advance(&wanted, 0.5).unwrap();
    assert!((measured.realized_wrench_body - wanted).to_vector().amax() < 1e-15);
    assert!((measured.stored_momentum_body + wanted.torque * 0.5).amax() < 1e-15);
    // wheels full: nozzles turn as well
    let full = State::<4>::repeat(-0.1);
    let mut plant = tumbling(((pyramid(), nozzles), (full, ())));
    let turn = Wrench::new(Vector3::z() * 0.01, Vector3::zeros());
    let measured = plant.advance(&turn, 0.5).unwrap();
    assert!((measured.realized_wrench_body - turn).to_vector().amax() < 1e-12);
    assert!(measured.stored_momentum_body.z.abs() > 0.28, "{}", measured.stored_momentum_body);
}

/// What a machine makes of its own answers.
struct Broken<'a, A: Actuation> {
    machine: &'a A,
    allocate: fn(&A, &Wrench<f64>) -> Result<A::Command, DynamicsError>,
    realize: fn(&A, &A::Command) -> Wrench<f64>,
}

impl<'a, A: Actuation> Broken<'a, A> {
    fn allocating(machine: &'a A, allocate: fn(&A, &Wrench<f64>) -> Result<A::Command, DynamicsError>) -> Self {
        Self { machine, allocate, realize: A::realize }
    }
    fn realizing(machine: &'a A, realize: fn(&A, &A::Command) -> Wrench<f64>) -> Self {
        Self { machine, allocate: A::allocate, realize }
    }
}

impl<A: Actuation> Actuation for Broken<'_, A> {
    type Command = A::Command;
    fn allocate(&self, wrench_body: &Wrench<f64>) -> Result<A::Command, DynamicsError> {
        (self.allocate)(self.machine, wrench_body)
    }
    fn realize(&self, command: &A::Command) -> Wrench<f64> {
        (self.realize)(self.machine, command)
    }
}

fn law_of(outcome: Result<(), LawViolation>) -> &'static str {
    outcome.expect_err("the defect goes unnoticed").law
}

#[test]
fn defects_of_thrusters_are_caught_by_name() {
    type Set = ThrusterSet<12>;
    let set = Set::try_new(pairs(0.112, 0.0965)).unwrap();
    let law = |broken: Broken<Set>| law_of(check_thrusters(&set, &broken));
    // pulls as well
    let pulls = |set: &Set, wrench: &Wrench<f64>| Ok(set.allocate(wrench)? - set.allocate(&-*wrench)?);
    assert_eq!(law(Broken::allocating(&set, pulls)), "limits are never exceeded");
    // pushes harder when told to
    let told = |set: &Set, thrusts: &State<12>| {
        let full = set.thrusters().iter().zip(thrusts);
        full.fold(Wrench::zero(), |sum, (thruster, thrust)| sum + thruster.wrench_body() * (thrust / 0.112))
    };
    assert_eq!(law(Broken::realizing(&set, told)), "limits are never exceeded");
    // a dead thruster
    let dead = |set: &Set, thrusts: &State<12>| {
        let mut thrusts = *thrusts;
        thrusts[5] = 0.0;
        set.realize(&thrusts)
    };
    assert_eq!(law(Broken::realizing(&set, dead)), "what lies inside the limits is realised");
    // creeps towards zero once saturated
    let creeps = |set: &Set, wrench: &Wrench<f64>| {
        let thrusts = set.allocate(wrench)?;
        Ok(if thrusts.amax() < 0.112 * 0.999 { thrusts } else { thrusts * 0.9995 })
    };
    assert_eq!(law(Broken::allocating(&set, creeps)), "what was realised can be realised again");
    let careless = |set: &Set, wrench: &Wrench<f64>| Ok(set.allocate(wrench).unwrap_or_default());
    assert_eq!(law(Broken::allocating(&set, careless)), "a wrench that is not finite is refused");
}

#[test]
fn defects_of_rotors_are_caught_by_name() {
    type Set = RotorSet<6>;
    let set = Set::try_new(tilted_rotors()).unwrap();
    let law = |broken: Broken<Set>| law_of(check_rotors(&broken));
    // no saturation
    let unlimited = |set: &Set, wrench: &Wrench<f64>| {
        let part = wrench.to_vector().amax() * 10.0;
        Ok(set.allocate(&(*wrench * (1.0 / part)))? * part.sqrt())
    };
    assert_eq!(law(Broken::allocating(&set, unlimited)), "limits are never exceeded");
    // thrust the same either way
    let one_way = |set: &Set, speeds: &Vector6<f64>| set.realize(&speeds.abs());
    assert_eq!(law(Broken::realizing(&set, one_way)), "what lies inside the limits is realised");
    let careless = |set: &Set, wrench: &Wrench<f64>| Ok(set.allocate(wrench).unwrap_or_default());
    assert_eq!(law(Broken::allocating(&set, careless)), "a wrench that is not finite is refused");
}

/// Wheels with one part exchanged.
struct BrokenWheels {
    allocate: fn(&State<4>, &Wrench<f64>, f64) -> Result<State<4>, DynamicsError>,
    realize: fn(&State<4>, &State<4>, f64) -> Wrench<f64>,
    advance: fn(&State<4>, &State<4>, f64) -> State<4>,
    stored: fn(&State<4>) -> Option<Vector3<f64>>,
}

impl Default for BrokenWheels {
    fn default() -> Self {
        Self {
            allocate: |momentum, wrench, hold_s| pyramid().allocate_over(momentum, wrench, hold_s),
            realize: |momentum, torques, hold_s| pyramid().realize_over(momentum, torques, hold_s),
            advance: |momentum, torques, hold_s| pyramid().advanced(momentum, torques, hold_s),
            stored: |momentum| pyramid().stored_momentum_body(momentum),
        }
    }
}

impl StatefulActuation for BrokenWheels {
    type Inner = State<4>;
    type Command = State<4>;
    fn allocate_over(&self, m: &State<4>, wrench: &Wrench<f64>, hold_s: f64) -> Result<State<4>, DynamicsError> {
        (self.allocate)(m, wrench, hold_s)
    }
    fn realize_over(&self, momentum: &State<4>, torques: &State<4>, hold_s: f64) -> Wrench<f64> {
        (self.realize)(momentum, torques, hold_s)
    }
    fn advanced(&self, momentum: &State<4>, torques: &State<4>, hold_s: f64) -> State<4> {
        (self.advance)(momentum, torques, hold_s)
    }
    fn stored_momentum_body(&self, momentum: &State<4>) -> Option<Vector3<f64>> {
        (self.stored)(momentum)
    }
}

#[test]
fn defects_of_reaction_wheels_are_caught_by_name() {
    let at_rest = State::<4>::zeros();
    let law = |broken: BrokenWheels| law_of(check_wheels(&broken, &at_rest, 0.01));
    // the torque of the motor in place of the body's
    let own = BrokenWheels { realize: |m, torques, s| -pyramid().realize_over(m, torques, s), ..Default::default() };
    assert_eq!(law(own), "what lies inside the limits is realised");
    // a force from nowhere
    let pushes = BrokenWheels {
        realize: |m, torques, s| {
            pyramid().realize_over(m, torques, s) + Wrench::new(Vector3::zeros(), Vector3::x() * 1e-3)
        },
        ..Default::default()
    };
    assert_eq!(law(pushes), "limits are never exceeded");
    // wheels that spin without end
    let endless = || BrokenWheels {
        allocate: |_, wrench, s| pyramid().allocate_over(&State::zeros(), wrench, s),
        ..Default::default()
    };
    assert_eq!(law_of(check_wheels(&endless(), &State::repeat(0.095), 0.01)), "limits are never exceeded");
    // looks at the torque only
    let half = BrokenWheels {
        allocate: |m, wrench, s| pyramid().allocate_over(m, &Wrench::new(wrench.torque, Vector3::zeros()), s),
        ..Default::default()
    };
    assert_eq!(law(half), "a wrench that is not finite is refused");
}

/// Wheels held as if they were nozzles: neither filled nor precessing.
struct Nozzles;
impl Actuation for Nozzles {
    type Command = State<4>;
    fn allocate(&self, wrench: &Wrench<f64>) -> Result<State<4>, DynamicsError> {
        pyramid().allocate_over(&State::zeros(), wrench, 0.5)
    }
    fn realize(&self, command: &State<4>) -> Wrench<f64> {
        pyramid().realize_over(&State::zeros(), command, 0.5)
    }
}

#[test]
fn defects_of_stored_momentum_are_caught_by_name() {
    type Wheels = BrokenWheels;
    // never saturates
    let endless = Wheels {
        allocate: |_, wrench, s| pyramid().allocate_over(&State::zeros(), wrench, s),
        realize: |_, torques, s| pyramid().realize_over(&State::zeros(), torques, s),
        advance: |momentum, torques, s| momentum + pyramid().advanced(&State::zeros(), torques, s),
        ..Wheels::default()
    };
    assert_eq!(law_of(check_storage(&endless)), "the storage never overflows");
    // never filled: a torque from nowhere
    let frozen = || Wheels { advance: |momentum, _, _| *momentum, ..Wheels::default() };
    assert_eq!(law_of(check_storage(&frozen())), "what the body gets the storage gives");
    let wrong_sign = || Wheels {
        stored: |momentum| pyramid().stored_momentum_body(momentum).map(|stored| -stored),
        ..Wheels::default()
    };
    let untold = Wheels { stored: |_| None, ..Wheels::default() };
    for broken in [wrong_sign(), untold] {
        assert_eq!(law_of(check_storage(&broken)), "what the body gets the storage gives");
    }
    let pushes = Wheels {
        realize: |m, torques, s| pyramid().realize_over(m, torques, s) + Wrench::new(Vector3::zeros(), Vector3::x()),
        ..Wheels::default()
    };
    assert_eq!(law_of(check_storage(&pushes)), "no force");
    // in a plant
    let momentum = State::<4>::from_column_slice(&[0.05, -0.02, 0.08, 0.0]);
    for broken in [frozen(), wrong_sign()] {
        assert_eq!(law_of(check_plant((broken, momentum))), "total momentum is kept");
    }
    assert_eq!(law_of(check_plant((Nozzles, ()))), "total momentum is kept");
}
