//! The tasks of the local planner's benchmark and studies, for the judge.

use std::array::from_fn;

use crate::local_checker::{LocalTask, Moment, Solid};

/// At the origin, at rest.
const AT_ORIGIN: Moment = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
pub const GOAL: [f64; 3] = [0.9, 0.4, 0.2];
const MASS_KG: f64 = 9.5838;
const INERTIA: [f64; 3] = [0.1534, 0.1427, 0.1623];
/// Torque and force.
pub const WRENCH: [f64; 6] = [0.045, 0.022, 0.026, 0.452, 0.216, 0.257];
const OBSTACLES: [Solid; 2] = [([0.45, 0.12, 0.10], [0.25, 0.20, 0.20]), ([0.70, 0.50, 0.0], [0.20, 0.20, 0.25])];
/// Where mass and the diagonal of the inertia stand among the parameters.
const PRINCIPAL: [usize; 4] = [0, 4, 7, 9];

/// Problem 8.
pub fn frozen_task() -> LocalTask<4> {
    let information = [1.0, 400.0, 400.0, 400.0];
    let mut parameters = [0.0; 10];
    for (place, value) in PRINCIPAL.into_iter().zip([MASS_KG, INERTIA[0], INERTIA[1], INERTIA[2]]) {
        parameters[place] = value;
    }
    task(parameters, PRINCIPAL.map(unit), information, [1.0, 1000.0, 1000.0, 1000.0])
}

/// A short way in free space with the weights and limits of the thesis's planner, and what its filter knows at the start;
/// everything is measured at 40 nodes. No information weights.
pub fn short_way(goal: [f64; 3]) -> LocalTask<4> {
    LocalTask {
        goal,
        step_s: 0.3,
        tracking: [10.0, 1.0, 5.0, 1.0],
        terminal: [100.0; 4],
        effort: [1.0, 1.0],
        measured: [0.01, 0.01, 0.005, 0.005],
        wrench: [0.015, 0.015, 0.015, 0.15, 0.15, 0.15],
        speed_m_s: f64::INFINITY,
        rate_rad_s: f64::INFINITY,
        obstacles: Vec::new(),
        prior_information: diagonal(&[1.0 / 15.0, 200.0, 200.0, 200.0]),
        information_weights: [0.0; 4],
        ..frozen_task()
    }
}

/// A body with its centre of mass off the origin and products of inertia, all unknown: mass, centre of mass, and inertia about
/// it. The rest is problem 8's.
pub fn ten_parameter_task(step_s: f64) -> LocalTask<10> {
    let believed = [MASS_KG, 0.02, -0.015, 0.01, INERTIA[0], 0.004, -0.003, INERTIA[1], 0.002, INERTIA[2]];
    // quadratic along each quantity: the central difference is the derivative
    let by_quantity = |place: usize| {
        let moved = |sign: f64| parameters_of(&from_fn(|i| believed[i] + if i == place { sign } else { 0.0 }));
        let (up, down) = (moved(1.0), moved(-1.0));
        from_fn(|i| 0.5 * (up[i] - down[i]))
    };
    let sd = [1.0, 0.02, 0.02, 0.02, 0.05, 0.02, 0.02, 0.05, 0.02, 0.05];
    let weights: [f64; 10] = from_fn(|i| if i == 0 { 1.0 } else { 1000.0 });
    LocalTask { step_s, ..task(parameters_of(&believed), from_fn(by_quantity), sd.map(|sd| 1.0 / (sd * sd)), weights) }
}

/// Mass, first moment and inertia about the origin, from mass, centre of mass and inertia about it.
fn parameters_of(quantities: &[f64; 10]) -> [f64; 10] {
    let [mass, c0, c1, c2, ..] = *quantities;
    let c = [c0, c1, c2];
    let square = c0 * c0 + c1 * c1 + c2 * c2;
    let mut parameters = *quantities;
    parameters[1..4].copy_from_slice(&c.map(|x| mass * x));
    for (place, (i, j)) in (4..).zip([(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)]) {
        parameters[place] += mass * (if i == j { square } else { 0.0 } - c[i] * c[j]);
    }
    parameters
}

fn diagonal<const P: usize>(entries: &[f64; P]) -> [[f64; P]; P] {
    from_fn(|i| from_fn(|j| if i == j { entries[i] } else { 0.0 }))
}

fn unit(place: usize) -> [f64; 10] {
    from_fn(|i| if i == place { 1.0 } else { 0.0 })
}

fn task<const P: usize>(
    parameters: [f64; 10],
    quantities: [[f64; 10]; P],
    information: [f64; P],
    information_weights: [f64; P],
) -> LocalTask<P> {
    LocalTask {
        parameters,
        quantities,
        prior_information: diagonal(&information),
        information_weights,
        start: AT_ORIGIN,
        goal: GOAL,
        step_s: 0.5,
        tracking: [1.0, 1.0, 0.5, 0.5],
        terminal: [1.0, 1.0, 0.5, 0.5],
        effort: [10.0, 1.0],
        measured: [f64::INFINITY, f64::INFINITY, 0.005, 0.005],
        wrench: WRENCH,
        speed_m_s: 0.2,
        rate_rad_s: 0.3,
        obstacles: OBSTACLES.to_vec(),
    }
}

/// Torque and force of each step from the prototype's unknowns: `[torque of all steps | force of all steps]`, over the limits.
#[cfg(test)]
pub fn inputs_of_prototype(z: &[f64]) -> Vec<[f64; 6]> {
    let half = z.len() / 2;
    let input = |k: usize| from_fn(|i| WRENCH[i] * if i < 3 { z[3 * k + i] } else { z[half + 3 * k + i - 3] });
    (0..half / 3).map(input).collect()
}
