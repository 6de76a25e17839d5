//! Problem 9, tube MPC: supports, the frozen nominal program warm and cold, the tube of one axis, three axes coupled by planes.
//!
//! A closed loop is flown several times and every step's best time counts, so that what else runs on the machine does not; median,
//! 99th percentile and worst are over the steps.

use std::hint::black_box;
use std::time::Instant;

use tumble_planning::PlanningError;
use tumble_planning::control::{
    AxisGain, AxisTemplate, GramStatus, GramWorkspace, MinimalInvariantSet, SymmetricBox, discrete_lqr,
};
use tumble_planning::nalgebra::{Matrix2x3, Matrix3, Matrix6, SMatrix, Vector2, Vector6};

use crate::Failure;
use crate::bench::{Bench, Goal, Row, quantile};
use crate::planning_runs::sorted;
use crate::tube_flights::Series;
use crate::tube_plant::{Bounds, Decision, Plant};
use crate::tube_shares::{JUMP, MASS_KG};

#[allow(clippy::float_cmp, clippy::needless_range_loop, reason = "as in the tests it belongs to")]
#[path = "../../../crates/planning/tests/suite/tube_problems/mod.rs"]
mod tube_problems;

use tube_problems::NominalLoop;
use tube_problems::coupled::CoupledLoop;

const PROBLEM: &str = "tube";
/// Flights of the closed loops: of the frozen program, and of one axis.
const FLIGHTS: usize = 15;
const AXIS_FLIGHTS: usize = 5;
/// Steps of the frozen loop, and what its plans cost together.
const FROZEN_STEPS: usize = 150;
const FROZEN_COST: f64 = -28_549.724_834;
/// Mass of the frozen problem, kg.
const FROZEN_KG: f64 = 9.5838;
/// Missions and steps of the other loops.
const MISSIONS: usize = 10;
const MISSION_STEPS: usize = 400;
const COUPLED_MISSIONS: usize = 60;
const COUPLED_STEPS: usize = 150;

/// Targets, ns.
struct Targets {
    median: Option<f64>,
    p99: Option<f64>,
    worst: Option<f64>,
    peer: Option<(&'static str, f64)>,
}

#[allow(clippy::needless_pass_by_value)] // given to `map_err`
fn failed(error: PlanningError) -> Failure {
    Failure::BadInput(format!("tube: {error}"))
}

pub fn run(bench: &mut Bench) -> Result<(), Failure> {
    sets(bench).map_err(failed)?;
    for is_warm in [true, false] {
        frozen(bench, is_warm);
    }
    axis(bench).map_err(failed)?;
    coupled(bench);
    Ok(())
}

/// A row for the median, and one for every other target.
fn report(
    bench: &Bench,
    item: &'static str,
    calibration_ns: f64,
    times_ns: Vec<f64>,
    targets: &Targets,
    quality: &[(&'static str, f64)],
) {
    let times = sorted(times_ns.into_iter());
    let [median, p99, worst] = [0.5, 0.99, 1.0].map(|share| quantile(&times, share));
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    let mut quality = quality.to_vec();
    quality.extend([("mean_ns", mean), ("worst_ns", worst)]);
    let row = |item: &'static str, median_ns: f64, target_ns: Option<f64>, quality: Vec<(&'static str, f64)>| Row {
        problem: PROBLEM,
        item,
        median_ns,
        p99_ns: p99,
        n: times.len(),
        quality,
        goal: Goal { target_ns, peer: targets.peer },
        calibration_ns,
    };
    bench.report(&row(item, median, targets.median, quality));
    for (name, found, target) in [("p99", p99, targets.p99), ("worst", worst, targets.worst)] {
        if target.is_some() {
            bench.report(&row(format!("{item}/{name}").leak(), found, target, Vec::new()));
        }
    }
}

/// Every step's best time over several flights of a deterministic loop.
struct BestTimes(Vec<f64>);

impl BestTimes {
    fn new(steps: usize) -> Self {
        Self(vec![f64::INFINITY; steps])
    }

    fn time<T>(&mut self, step: usize, call: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let answer = black_box(call());
        let elapsed = start.elapsed().as_nanos() as f64;
        if let Some(best) = self.0.get_mut(step) {
            *best = best.min(elapsed);
        }
        answer
    }
}

fn sets(bench: &Bench) -> Result<(), PlanningError> {
    let gain = AxisGain::default();
    bench.sweep(PROBLEM, "template", Goal::default(), 16, &[], |i| {
        AxisTemplate::try_new(gain, &SymmetricBox(Vector2::from(JUMP) * (1.0 + i as f64)))
    });
    let target = Goal { target_ns: Some(5e3), peer: None };
    // the frozen problem: a lightly damped loop, 1e-6
    let (a, b) = (SMatrix::<f64, 2, 2>::new(1.0, 0.2, 0.0, 1.0), Vector2::new(0.02, 0.2) / FROZEN_KG);
    let weight = SMatrix::<f64, 2, 2>::from_diagonal(&Vector2::new(10.0, 1.0));
    let (feedback, _) = discrete_lqr(&a, &b, &weight, &SMatrix::<f64, 1, 1>::identity())?;
    let closed_loop = a + b * feedback;
    let half_widths = Vector2::new(5e-4, 1e-3);
    let directions = Matrix2x3::from_columns(&[Vector2::x(), Vector2::y(), feedback.transpose()]);
    let set = MinimalInvariantSet::try_new(closed_loop, SymmetricBox(half_widths))?;
    let found = set.supports(&directions, 1e-6);
    let quality = [("position", found.x), ("velocity", found.y), ("input", found.z)];
    bench.sweep(PROBLEM, "supports/axis", target, 16, &quality, |_| set.supports(&directions, 1e-6));
    bench.sweep(PROBLEM, "supports/axis_and_set", Goal::default(), 16, &quality, |_| {
        MinimalInvariantSet::try_new(closed_loop, SymmetricBox(half_widths)).map(|set| set.supports(&directions, 1e-6))
    });

    // three axes as one system of six states; nine directions
    let mut loop_of_six = Matrix6::zeros();
    let mut directions = SMatrix::<f64, 6, 9>::zeros();
    for axis in 0..3 {
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            loop_of_six[(axis + 3 * i, axis + 3 * j)] = closed_loop[(i, j)];
        }
        directions[(axis, axis)] = 1.0;
        directions[(axis + 3, axis + 3)] = 1.0;
        (directions[(axis, axis + 6)], directions[(axis + 3, axis + 6)]) = (feedback[0], feedback[1]);
    }
    let mut widths = Vector6::repeat(half_widths.x);
    widths.fixed_rows_mut::<3>(3).fill(half_widths.y);
    // coupled by a turn of the axes between position and velocity, which leaves the box but no zero
    let turn = Matrix3::new(2.0, -1.0, 2.0, 2.0, 2.0, -1.0, -1.0, 2.0, 2.0) / 3.0;
    let mut turned = Matrix6::zeros();
    turned.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
    turned.fixed_view_mut::<3, 3>(3, 3).copy_from(&turn);
    let loop_of_six = turned * loop_of_six * turned.transpose();
    let set = MinimalInvariantSet::try_new(loop_of_six, SymmetricBox(widths))?;
    let target = Goal { target_ns: Some(60e3), peer: None };
    let terms: usize = directions.column_iter().map(|row| set.support(&row.into_owned(), 1e-6).terms).sum();
    let quality = [("terms", terms as f64), ("position", set.supports(&directions, 1e-6)[0])];
    bench.sweep(PROBLEM, "supports/coupled", target, 16, &quality, |_| set.supports(&directions, 1e-6));
    Ok(())
}

fn frozen(bench: &Bench, is_warm: bool) {
    let (item, median, worst) =
        if is_warm { ("frozen/warm", Some(5e3), Some(60e3)) } else { ("frozen/cold", Some(15e3), None) };
    if !bench.wants(PROBLEM, item) {
        return;
    }
    let calibration_ns = bench.calibrate();
    let mut best = BestTimes::new(FROZEN_STEPS);
    let (mut cost, mut violation, mut most, mut iterations) = (0.0, f64::NEG_INFINITY, 0, Vec::new());
    for flight in 0..FLIGHTS {
        let mut closed = NominalLoop::new();
        closed.restart();
        for step in 0..FROZEN_STEPS {
            best.time(step, || closed.solve(is_warm));
            if flight == 0 {
                for axis in 0..3 {
                    let inputs = closed.workspaces[axis].solution();
                    let (one, beyond) = closed.nominal.cost_and_violation(axis, closed.states[axis], inputs);
                    cost += one;
                    violation = f64::max(violation, beyond);
                }
                let changes: usize = closed.workspaces.iter().map(GramWorkspace::iterations).sum();
                most = most.max(changes);
                iterations.push(changes as f64);
            }
            closed.advance();
        }
    }
    let quality = [
        ("cost_sum", cost),
        ("relative_cost_error", (cost / FROZEN_COST - 1.0).abs()),
        ("largest_violation", violation),
        ("median_iterations", quantile(&sorted(iterations.into_iter()), 0.5)),
        ("most_iterations", most as f64),
    ];
    let peer = Some(if is_warm { ("OSQP 1e-3", 130e3) } else { ("DAQP", 211e3) });
    report(bench, item, calibration_ns, best.0, &Targets { median, p99: None, worst, peer }, &quality);
}

/// One axis with an uncertain mass, in closed loop.
fn axis(bench: &Bench) -> Result<(), PlanningError> {
    let series = Series::usual(MASS_KG);
    let template = series.template()?;
    bench.sweep(PROBLEM, "axis/set_up", Goal::default(), 4, &[], |_| series.axis(&template, 0, series.mass_kg));
    for (item, is_warm) in [("axis/warm", true), ("axis/cold", false)] {
        if !bench.wants(PROBLEM, item) {
            continue;
        }
        let calibration_ns = bench.calibrate();
        let first = series.axis(&template, 0, series.mass_kg)?;
        let mut best = BestTimes::new(MISSIONS * MISSION_STEPS);
        let (mut changes, mut most, mut unsolved) = (0, 0, 0);
        for _ in 0..AXIS_FLIGHTS {
            for mission in 0..MISSIONS {
                let bounds = Bounds { force_n: series.force_n[0], speed_m_s: series.speed_m_s, walls_m: [-0.45, 0.45] };
                let mass_kg = series.mass_kg[mission % 2];
                let mut plant = Plant::new(mass_kg, 0.2, -0.3, bounds, series.disturbances, mission as u64);
                plant.draw_policy();
                // every third goal is behind the wall
                let goal = [Vector2::new(if mission % 3 == 0 { 0.6 } else { 0.3 }, 0.0)];
                let mut tube = first.clone();
                for step in 0..MISSION_STEPS {
                    let measured = Vector2::from(plant.measured());
                    if !is_warm {
                        tube = first.clone();
                    }
                    let place = mission * MISSION_STEPS + step;
                    let status = best.time(place, || tube.solve(&measured, &goal));
                    unsolved += usize::from(status != GramStatus::Solved);
                    changes += tube.iterations();
                    most = most.max(tube.iterations());
                    let plan = tube.plan();
                    plant.step(&Decision {
                        force_n: tube.force_n(&measured),
                        center_kg: tube.problem().center_kg,
                        gain: [template.gain.stiffness, template.gain.damping],
                        start: plan.start.into(),
                        acceleration_m_s2: plan.accelerations.first().copied().unwrap_or(0.0),
                        faces: &[],
                    });
                    tube.advance();
                }
            }
        }
        let solves = (AXIS_FLIGHTS * best.0.len()) as f64;
        let quality = [
            ("mean_iterations", changes as f64 / solves),
            ("most_iterations", most as f64),
            ("unsolved", unsolved as f64),
        ];
        let none = Targets { median: None, p99: None, worst: None, peer: None };
        report(bench, item, calibration_ns, best.0, &none, &quality);
    }
    Ok(())
}

/// Three axes, 10 planes at 25 steps: 84 unknowns, 736 rows.
fn coupled(bench: &Bench) {
    let item = "coupled/warm";
    if !bench.wants(PROBLEM, item) {
        return;
    }
    let calibration_ns = bench.calibrate();
    let mut best = BestTimes::new(COUPLED_MISSIONS * COUPLED_STEPS);
    let mut worst = [f64::NEG_INFINITY; 2];
    let (mut most, mut unsolved, mut size) = (0, 0, [0; 2]);
    for _ in 0..3 {
        let mut closed = CoupledLoop::new();
        size = [closed.program.unknowns(), closed.program.rows()];
        for mission in 0..COUPLED_MISSIONS {
            closed.restart();
            for step in 0..COUPLED_STEPS {
                closed.write();
                let status = best.time(mission * COUPLED_STEPS + step, || closed.solve());
                unsolved += usize::from(status != GramStatus::Solved);
                most = most.max(closed.workspace.iterations());
                let beyond = closed.advance();
                worst = [f64::max(worst[0], beyond[0]), f64::max(worst[1], beyond[1])];
            }
        }
    }
    let quality = [
        ("unknowns", size[0] as f64),
        ("rows", size[1] as f64),
        ("most_iterations", most as f64),
        ("unsolved", unsolved as f64),
        ("force_excess_n", worst[0]),
        ("plane_excess_m", worst[1]),
    ];
    let targets = Targets { median: Some(80e3), p99: Some(1e6), worst: Some(5e6), peer: None };
    report(bench, item, calibration_ns, best.0, &targets, &quality);
}
