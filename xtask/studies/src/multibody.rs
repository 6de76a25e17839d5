//! Problem 2, arms: inverse and forward dynamics, generalised inertia and regressor of a base with two and seven joints.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use tumble_dynamics::{
    BodyAcceleration, Fixed, GeneralizedForce, GeneralizedMotion, InertialParameters, Joint, Link, Multibody,
};
use tumble_lie::{Pose, Twist, Wrench};

use crate::Failure;
use crate::bench::{Bench, Goal, numbers};
use tumble_identification::noise::signed_unit;

const PROBLEM: &str = "multibody";
const BASE_KG: f64 = 9.5838;
const BASE_INERTIA: [f64; 3] = [0.1534, 0.1427, 0.1623];
const LINK_M: f64 = 0.12;
const FIRST_JOINT_M: f64 = 0.15;

/// One state of the file; motion and forces do not belong together.
struct Case<const J: usize> {
    twist: Twist<f64>,
    acceleration: BodyAcceleration<f64>,
    positions: [f64; J],
    rates: [f64; J],
    accelerations: [f64; J],
    force: GeneralizedForce<f64, Fixed<J>>,
}

fn link_inertia(link_kg: f64) -> [f64; 3] {
    let across = link_kg * LINK_M * LINK_M / 12.0;
    [across, across, link_kg * 0.02 * 0.02 / 2.0]
}

fn arm<const J: usize>(axes: &[Vector3<f64>; J], link_kg: f64) -> Result<Multibody<f64, Fixed<J>>, Failure> {
    let body = |kg: f64, com: Vector3<f64>, inertia: [f64; 3]| {
        InertialParameters::about_com(kg, com, Matrix3::from_diagonal(&inertia.into()))
    };
    let center = Vector3::new(0.0, 0.0, -0.5 * LINK_M);
    let link = |(i, axis): (usize, &Vector3<f64>)| {
        let drop_m = if i == 0 { FIRST_JOINT_M } else { LINK_M };
        let joint = Joint::revolute(*axis, Pose::translation(0.0, 0.0, -drop_m)).map_err(refused)?;
        Ok(Link { parent: i.checked_sub(1), joint, body: body(link_kg, center, link_inertia(link_kg)) })
    };
    let links = axes.iter().enumerate().map(link).collect::<Result<Vec<_>, Failure>>()?;
    let links = <[Link<f64>; J]>::try_from(links).map_err(|_| refused("a link for each axis"))?;
    Multibody::try_new(body(BASE_KG, Vector3::zeros(), BASE_INERTIA), links).map_err(refused)
}

fn refused(error: impl std::fmt::Display) -> Failure {
    Failure::BadInput(error.to_string())
}

/// Forces by hand: Newton and Euler about each centre of mass, everything in base axes, gathered by virtual work.
fn plain_inverse<const J: usize>(
    axes: &[Vector3<f64>; J],
    link_kg: f64,
    twist: &Twist<f64>,
    base: &BodyAcceleration<f64>,
    [positions, rates, accelerations]: [&[f64; J]; 3],
) -> (Vector3<f64>, Vector3<f64>, [f64; J]) {
    let turning = |inertia: [f64; 3], r: &Rotation3<f64>| {
        r.matrix() * Matrix3::from_diagonal(&inertia.into()) * r.matrix().transpose()
    };
    let mut rotation = Rotation3::identity();
    let mut origin = Vector3::zeros();
    let (mut w, mut alpha, mut a) = (twist.angular, base.angular_acceleration_body, base.acceleration_origin_body);
    let inertia = turning(BASE_INERTIA, &rotation);
    // centre of mass, force and torque about it, of each body
    let mut loads = vec![(origin, a * BASE_KG, inertia * alpha + w.cross(&(inertia * w)))];
    let mut hinges = Vec::new();
    for i in 0..J {
        let drop_m = if i == 0 { FIRST_JOINT_M } else { LINK_M };
        let arm = rotation * Vector3::new(0.0, 0.0, -drop_m);
        a += alpha.cross(&arm) + w.cross(&w.cross(&arm));
        origin += arm;
        let axis = rotation * axes[i];
        alpha += axis * accelerations[i] + w.cross(&(axis * rates[i]));
        w += axis * rates[i];
        rotation *= Rotation3::from_scaled_axis(axes[i] * positions[i]);
        let lever = rotation * Vector3::new(0.0, 0.0, -0.5 * LINK_M);
        let inertia = turning(link_inertia(link_kg), &rotation);
        let force = (a + alpha.cross(&lever) + w.cross(&w.cross(&lever))) * link_kg;
        loads.push((origin + lever, force, inertia * alpha + w.cross(&(inertia * w))));
        hinges.push((origin, axis));
    }
    let about = |point: &Vector3<f64>, first: usize| -> Vector3<f64> {
        loads.iter().skip(first).map(|(center, force, torque)| torque + (center - point).cross(force)).sum()
    };
    let total = loads.iter().map(|(_, force, _)| force).sum();
    let joints = std::array::from_fn(|i| hinges[i].1.dot(&about(&hinges[i].0, i + 1)));
    (about(&Vector3::zeros(), 0), total, joints)
}

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    let (y, z) = (Vector3::y(), Vector3::z());
    let names = ["arm2_inverse_dynamics", "arm2_mass_matrix", "arm2_forward_dynamics", "arm2_torque_regressor"];
    measure(bench, &[y, y], 0.3, names, [309.0, 174.0, 684.0, 412.0])?;
    let names = ["arm7_inverse_dynamics", "arm7_mass_matrix", "arm7_forward_dynamics", "arm7_torque_regressor"];
    measure(bench, &[z, y, z, y, z, y, z], 0.5, names, [801.0, 453.0, 1850.0, 2170.0])
}

fn measure<const J: usize>(
    bench: &mut Bench,
    axes: &[Vector3<f64>; J],
    link_kg: f64,
    names: [&'static str; 4],
    peers_ns: [f64; 4],
) -> Result<(), Failure> {
    let tree = arm(axes, link_kg)?;
    let cases = cases::<J>(bench)?;
    let count = cases.len();
    let goals = peers_ns.map(|ns| Goal::at(ns, "pinocchio-cpp", ns));
    let motion = |case: usize| {
        let Case { twist, acceleration, positions, rates, accelerations, .. } = &cases[case];
        GeneralizedMotion { base_twist: *twist, base_acceleration: *acceleration, positions, rates, accelerations }
    };
    let still =
        BodyAcceleration { angular_acceleration_body: Vector3::zeros(), acceleration_origin_body: Vector3::zeros() };
    let plain = |case: &Case<J>, base: &BodyAcceleration<f64>, accelerations: &[f64; J], moving: bool| -> Vec<f64> {
        let (twist, rates) = if moving { (case.twist, case.rates) } else { (Twist::zero(), [0.0; J]) };
        let lists = [&case.positions, &rates, accelerations];
        let (torque, force, joints) = plain_inverse(axes, link_kg, &twist, base, lists);
        torque.iter().chain(&force).copied().chain(joints).collect()
    };
    let difference = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let worst = |error: &dyn Fn(usize) -> f64| [("max_error", (0..count).map(error).fold(0.0, f64::max))];

    let inverse = |i: usize| tree.inverse_dynamics(&motion(i));
    let quality = worst(&|i| {
        let case = &cases[i];
        let expected = plain(case, &case.acceleration, &case.accelerations, true);
        inverse(i).map_or(f64::INFINITY, |force| difference(&listed(&force), &expected))
    });
    bench.sweep(PROBLEM, names[0], goals[0], count, &quality, inverse);

    let mass_matrix = |i: usize| tree.mass_matrix(&cases[i].positions);
    let quality = worst(&|i| {
        // each column is what a unit acceleration takes from rest
        let Ok(matrix) = mass_matrix(i) else { return f64::INFINITY };
        let column = |k: usize| {
            let mut base = still;
            let mut accelerations = [0.0; J];
            match k {
                0..3 => base.angular_acceleration_body[k] = 1.0,
                3..6 => base.acceleration_origin_body[k - 3] = 1.0,
                _ => accelerations[k - 6] = 1.0,
            }
            let found: Vec<f64> = (0..6 + J).map(|row| matrix.get(row, k).unwrap_or(f64::INFINITY)).collect();
            difference(&found, &plain(&cases[i], &base, &accelerations, false))
        };
        (0..6 + J).map(column).fold(0.0, f64::max)
    });
    bench.sweep(PROBLEM, names[1], goals[1], count, &quality, mass_matrix);

    let forward = |i: usize| {
        let case = &cases[i];
        tree.forward_dynamics(&case.twist, &case.positions, &case.rates, &case.force)
    };
    let quality = worst(&|i| {
        let Ok(acceleration) = forward(i) else { return f64::INFINITY };
        let back = plain(&cases[i], &acceleration.base, &acceleration.joints, true);
        difference(&back, &listed(&cases[i].force))
    });
    bench.sweep(PROBLEM, names[2], goals[2], count, &quality, forward);

    let regressor = |i: usize| tree.torque_regressor(&motion(i));
    let bodies: Vec<_> =
        (0..tree.bodies()).filter_map(|body| tree.body(body)).map(InertialParameters::to_vector).collect();
    let quality = worst(&|i| {
        let Ok(found) = regressor(i) else { return f64::INFINITY };
        let row = |row: usize| -> f64 {
            let blocks = bodies.iter().enumerate().filter_map(|(body, p)| Some((found.block(row, body)?, p)));
            blocks.map(|(block, p)| block.iter().zip(p.iter()).map(|(a, b)| a * b).sum::<f64>()).sum()
        };
        let case = &cases[i];
        difference(
            &(0..6 + J).map(row).collect::<Vec<_>>(),
            &plain(case, &case.acceleration, &case.accelerations, true),
        )
    });
    bench.sweep(PROBLEM, names[3], goals[3], count, &quality, regressor);
    Ok(())
}

fn listed<const J: usize>(force: &GeneralizedForce<f64, Fixed<J>>) -> Vec<f64> {
    force.base.to_vector().iter().copied().chain(force.joints).collect()
}

/// The frozen states, or others of the same kind; the first joints of each where there are fewer than seven.
fn cases<const J: usize>(bench: &Bench) -> Result<Vec<Case<J>>, Failure> {
    let mut generator = ChaCha8Rng::seed_from_u64(2);
    let rows = if let Some(folder) = &bench.data {
        numbers(&folder.join("mb_states.csv"))?
    } else {
        eprintln!("skipped: the frozen inputs of problem 2 (--data DIR); states are drawn from seed 2");
        (0..64).map(|_| (0..53).map(|_| signed_unit(&mut generator)).collect()).collect()
    };
    let case = |row: &Vec<f64>| {
        if row.len() < 53 {
            return Err(Failure::BadInput("mb_states.csv: a row has fewer than 53 numbers".into()));
        }
        // position 3, quaternion 4, joints 7, then linear 3, angular 3, joints 7 of twist, acceleration and forces
        let vector = |start: usize| Vector3::from_column_slice(&row[start..start + 3]);
        let joints = |start: usize| -> [f64; J] { std::array::from_fn(|i| row[start + i]) };
        let twist = Twist::new(vector(17), vector(14));
        let twist_rate = Twist::new(vector(30), vector(27));
        Ok(Case {
            twist,
            acceleration: BodyAcceleration::from_twist_rate_body(&twist, &twist_rate),
            positions: joints(7),
            rates: joints(20),
            accelerations: joints(33),
            force: GeneralizedForce { base: Wrench::new(vector(43), vector(40)), joints: joints(46) },
        })
    };
    rows.iter().map(case).collect()
}
