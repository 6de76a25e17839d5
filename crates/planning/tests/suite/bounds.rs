//! The route bound against exact and brute-force optima: never above, close where it can be, no way denied that exists.

#![expect(clippy::unwrap_used, reason = "a test")]

use std::collections::BTreeMap;

use proptest::prelude::*;
use tumble_planning::collision::{Blocker, BodyEllipsoid, BodyShape, Clearance, CollisionWorld, Contact};
use tumble_planning::dynamics::{AlignedBox, InertialParameters};
use tumble_planning::global::{
    GlobalRequest, GoalRegion, MotionLimits, Objective, Obstruction, Reachability, RouteBound, Until, diagnose,
};
use tumble_planning::lie::Pose;
use tumble_planning::nalgebra::{Matrix3, UnitQuaternion, Vector3};
use tumble_planning::{BodyArc, ModelBelief, PlanningError, TranslationState, Units};

/// Solid boxes; the body is a sphere of this radius.
#[derive(Debug)]
struct Boxes {
    solid: Vec<AlignedBox>,
    /// Only there until this time.
    leaving: Option<(AlignedBox, f64)>,
    /// By how much the clearance is reported too small, m: other than zero is a planted defect.
    lie_m: f64,
}

fn signed_distance(solid: &AlignedBox, point: &Vector3<f64>) -> f64 {
    let out = (solid.lower_world - point).sup(&(point - solid.upper_world));
    let outside = out.sup(&Vector3::zeros()).norm();
    if outside > 0.0 { outside } else { out.max() }
}

impl Boxes {
    fn new(solid: Vec<AlignedBox>) -> Self {
        Self { solid, leaving: None, lie_m: 0.0 }
    }

    fn nearest(&self, radius_m: f64, point: &Vector3<f64>) -> Clearance {
        let mut nearest = Clearance { distance_m: f64::INFINITY, nearest: None };
        for (index, solid) in self.solid.iter().enumerate() {
            let distance_m = signed_distance(solid, point) - radius_m - self.lie_m;
            if distance_m < nearest.distance_m {
                nearest = Clearance { distance_m, nearest: Some(Blocker::KeepOut(index)) };
            }
        }
        nearest
    }
}

impl CollisionWorld for Boxes {
    type Body = f64;

    fn clearance(&self, body: &f64, pose: &Pose<f64>, time_s: f64) -> Result<Clearance, PlanningError> {
        let mut nearest = self.nearest(*body, &pose.translation.vector);
        if let Some((solid, until_s)) = &self.leaving {
            let distance_m = signed_distance(solid, &pose.translation.vector) - body;
            if time_s < *until_s && distance_m < nearest.distance_m {
                nearest = Clearance { distance_m, nearest: Some(Blocker::Obstacle(0)) };
            }
        }
        Ok(nearest)
    }

    fn first_contact(&self, _: &f64, _: &BodyArc, _: f64, _: f64) -> Result<Option<Contact>, PlanningError> {
        Err(PlanningError::Unsupported { query: "follow a motion" })
    }

    fn lasting_clearance(&self, body: &f64, pose: &Pose<f64>, _: f64) -> Result<Clearance, PlanningError> {
        Ok(self.nearest(*body, &pose.translation.vector))
    }

    fn reach_m(&self, body: &f64) -> f64 {
        *body
    }
}

fn solid(lower: [f64; 3], upper: [f64; 3]) -> AlignedBox {
    AlignedBox { lower_world: lower.into(), upper_world: upper.into() }
}

/// A box on a table: as high as one likes.
fn block(x: [f64; 2], y: [f64; 2]) -> AlignedBox {
    solid([x[0], y[0], -9.0], [x[1], y[1], 9.0])
}

fn belief() -> ModelBelief {
    ModelBelief::certain(0, InertialParameters::about_origin(2.0, Vector3::zeros(), Matrix3::identity()))
}

/// A problem on a table; acceleration and speed along both axes.
#[derive(Debug)]
struct Table {
    world: Boxes,
    radius_m: f64,
    belief: ModelBelief,
    half_m: f64,
    start: [f64; 2],
    goal: [f64; 2],
    goal_radius_m: f64,
    speed_m_s: [f64; 2],
    acceleration_m_s2: f64,
}

impl Table {
    fn new(solid: Vec<AlignedBox>, start: [f64; 2], goal: [f64; 2]) -> Self {
        Self {
            world: Boxes::new(solid),
            radius_m: 0.0,
            belief: belief(),
            half_m: 3.0,
            start,
            goal,
            goal_radius_m: 0.0,
            speed_m_s: [1.0; 2],
            acceleration_m_s2: 1e7,
        }
    }

    fn request(&self) -> GlobalRequest<'_, Boxes> {
        let half = Vector3::new(self.half_m, self.half_m, 0.0);
        GlobalRequest {
            world: &self.world,
            body: &self.radius_m,
            start: TranslationState::at_rest(Vector3::new(self.start[0], self.start[1], 0.0)),
            attitude: UnitQuaternion::identity(),
            start_s: 0.0,
            goal: GoalRegion {
                position: Vector3::new(self.goal[0], self.goal[1], 0.0),
                radius_m: self.goal_radius_m,
                speed_m_s: 0.0,
                attitude: None,
            },
            limits: MotionLimits {
                position: AlignedBox { lower_world: -half, upper_world: half },
                speed_m_s: Vector3::new(self.speed_m_s[0], self.speed_m_s[1], 1.0),
                force_n: Vector3::repeat(2.0 * self.acceleration_m_s2),
                torque_n_m: Vector3::zeros(),
                rate_rad_s: 0.0,
            },
            belief: &self.belief,
            objective: Objective::Duration,
            margin_m: 0.0,
            until: Until::BudgetSpent,
            seed: 0,
        }
    }
}

/// The bound after so many refinements, or fewer where nothing more comes of them.
fn refined<'r>(request: &'r GlobalRequest<'r, Boxes>, refinements: usize) -> RouteBound<'r, Boxes> {
    let mut bound = RouteBound::new(request).unwrap();
    let mut budget = Units::new(u64::MAX);
    for _ in 0..refinements {
        if !bound.refine(&mut budget).unwrap() {
            break;
        }
    }
    bound
}

/// Exact length of the shortest path of a point among boxes in the norm of the longest scaled axis: in any norm one leads
/// over corners of the boxes (straightening a path never lengthens it).
fn shortest_length_s(table: &Table) -> f64 {
    let point = |p: [f64; 2]| Vector3::new(p[0], p[1], 0.0);
    let mut corners = vec![point(table.start), point(table.goal)];
    for solid in &table.world.solid {
        let (l, u) = (solid.lower_world, solid.upper_world);
        corners.extend([[l.x, l.y], [l.x, u.y], [u.x, l.y], [u.x, u.y]].map(point));
    }
    corners.retain(|corner| corner.x.abs().max(corner.y.abs()) <= table.half_m);
    let crosses = |a: &Vector3<f64>, b: &Vector3<f64>, solid: &AlignedBox| {
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        for axis in 0..2 {
            let (l, u) = (solid.lower_world[axis] + 1e-9, solid.upper_world[axis] - 1e-9);
            let slope = b[axis] - a[axis];
            if slope.abs() < 1e-15 {
                if a[axis] <= l || a[axis] >= u {
                    return false;
                }
                continue;
            }
            let (s, t) = ((l - a[axis]) / slope, (u - a[axis]) / slope);
            enter = enter.max(s.min(t));
            leave = leave.min(s.max(t));
        }
        enter < leave
    };
    let length = |a: &Vector3<f64>, b: &Vector3<f64>| {
        ((a.x - b.x) / table.speed_m_s[0]).abs().max(((a.y - b.y) / table.speed_m_s[1]).abs())
    };
    let mut least = vec![f64::INFINITY; corners.len()];
    let mut done = vec![false; corners.len()];
    least[0] = 0.0;
    while let Some(at) =
        (0..corners.len()).filter(|k| !done[*k] && least[*k].is_finite()).min_by(|a, b| least[*a].total_cmp(&least[*b]))
    {
        done[at] = true;
        for to in 0..corners.len() {
            if !done[to] && !table.world.solid.iter().any(|solid| crosses(&corners[at], &corners[to], solid)) {
                least[to] = least[to].min(least[at] + length(&corners[at], &corners[to]));
            }
        }
    }
    least[1]
}

#[test]
fn converges_to_the_closed_form_past_a_wall_with_a_slit() {
    // Two up, 0.4 across the wall, two down, while 0.8 are needed each way across: 4.4 s at unit speed.
    let table = Table::new(vec![block([-0.2, 0.2], [-9.0, 2.0])], [-1.0, 0.0], [1.0, 0.0]);
    let request = table.request();
    assert!((shortest_length_s(&table) - 4.4).abs() < 1e-9);
    let mut gaps = Vec::new();
    let mut bound = RouteBound::new(&request).unwrap();
    assert!((bound.least_duration_s() - 2.0).abs() < 1e-3);
    for _ in 0..5 {
        bound.refine(&mut Units::new(u64::MAX)).unwrap();
        gaps.push(4.4 + 1e-3 - bound.least_duration_s());
    }
    assert!(gaps.iter().all(|gap| *gap > 0.0), "{gaps:?}");
    assert!(gaps.windows(2).all(|pair| pair[1] <= pair[0]) && gaps[4] < 0.05, "{gaps:?}");
}

#[test]
fn a_forced_turn_costs_its_stop() {
    // At unit speed and acceleration, y goes out to two and back, resting at the top: each way takes its length and 1 s. The
    // wall is so thin that x passes while y is within 0.01 of the top. In all four directions.
    for (from, to) in [(0.0, 0.0), (-0.5, 1.0), (1.0, -0.5)] {
        let best_s = (2.0 - from) + 1.0 + (2.0 - to) + 1.0;
        for is_mirrored in [false, true] {
            for is_swapped in [false, true] {
                let place = |x: f64, y: f64| {
                    let y = if is_mirrored { -y } else { y };
                    if is_swapped { [y, x] } else { [x, y] }
                };
                let (low, high) = (place(-0.02, -9.0), place(0.02, 2.0));
                let span = |axis: usize| [low[axis].min(high[axis]), low[axis].max(high[axis])];
                let wall = block(span(0), span(1));
                let mut table = Table::new(vec![wall], place(-1.0, from), place(1.0, to));
                table.acceleration_m_s2 = 1.0;
                let least_s = refined(&table.request(), 5).least_duration_s();
                assert!(least_s <= best_s + 0.1 && least_s > best_s - 0.3, "{least_s} {best_s}");
            }
        }
    }
}

#[test]
fn a_straight_way_costs_its_length_and_its_start() {
    // 3.9 m at unit speed, half a second lost in starting; the goal may be passed at full speed.
    let mut table = Table::new(Vec::new(), [-2.0, 0.1], [2.0, 0.1]);
    (table.acceleration_m_s2, table.goal_radius_m) = (1.0, 0.1);
    let mut request = table.request();
    request.goal.speed_m_s = 2.0;
    let least_s = refined(&request, 3).least_duration_s();
    assert!((least_s - 4.4).abs() < 1e-9, "{least_s}");
}

/// A random table of boxes with start and goal free.
fn tables() -> impl Strategy<Value = Table> {
    let boxes = prop::collection::vec((-2.5..2.5, -2.5..2.5, 0.15..1.0, 0.15..1.0), 1..7);
    (boxes, 0.5..2.0).prop_map(|(boxes, second)| {
        let solid = boxes.into_iter().map(|(x, y, a, b): (f64, f64, f64, f64)| block([x - a, x + a], [y - b, y + b]));
        let solid: Vec<_> = solid.collect();
        let mut table = Table::new(solid, [-2.8, -2.8], [2.8, 2.7]);
        table.speed_m_s[1] = second;
        table
    })
}

fn is_clear(table: &Table, point: [f64; 2], distance_m: f64) -> bool {
    table.world.nearest(0.0, &Vector3::new(point[0], point[1], 0.0)).distance_m >= distance_m
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    #[test]
    fn is_never_above_the_exact_shortest_path(table in tables()) {
        prop_assume!(is_clear(&table, table.start, 0.0) && is_clear(&table, table.goal, 0.0));
        let request = table.request();
        let exact_s = shortest_length_s(&table);
        let mut bound = RouteBound::new(&request).unwrap();
        for _ in 0..6 {
            if !bound.refine(&mut Units::new(u64::MAX)).unwrap() {
                break;
            }
            // What the acceleration of 1e7 costs is far below the slack.
            prop_assert!(bound.least_duration_s() <= exact_s + 1e-4, "{} > {}", bound.least_duration_s(), exact_s);
        }
        match bound.reachability() {
            Reachability::Blocked(_) => prop_assert!(exact_s.is_infinite()),
            Reachability::Reachable => {
                prop_assert!(exact_s.is_finite());
                prop_assert!(bound.least_duration_s() > 0.85 * exact_s, "{} of {}", bound.least_duration_s(), exact_s);
            }
            Reachability::Unknown => {}
        }
    }

    #[test]
    fn a_free_route_is_free(table in tables()) {
        prop_assume!(is_clear(&table, table.start, 0.0) && is_clear(&table, table.goal, 0.0));
        let mut table = table;
        table.goal_radius_m = 0.1;
        let request = table.request();
        let bound = refined(&request, 3);
        let route = bound.free_route();
        prop_assert_eq!(route.is_empty(), *bound.reachability() != Reachability::Reachable);
        if let (Some(first), Some(last)) = (route.first(), route.last()) {
            prop_assert_eq!(*first, request.start.position);
            prop_assert!((last - request.goal.position).norm() <= 0.1);
        }
        for ends in route.windows(2) {
            for k in 0..=200 {
                let point = ends[0].lerp(&ends[1], f64::from(k) / 200.0);
                prop_assert!(table.world.nearest(0.0, &point).distance_m >= 0.0);
                prop_assert!(point.amax() <= table.half_m);
            }
        }
    }
}

/// Time-optimal motions on a lattice: accelerations of -a, 0 or a along each axis over equal steps, speeds up to three steps'
/// worth. Every one is a motion within the limits, so none may be shorter than the bound.
struct Lattice<'a> {
    table: &'a Table,
    step_s: f64,
}

/// Position in halves of `a step^2`, velocity in `a step`.
type Node = [i32; 4];

impl Lattice<'_> {
    const FASTEST: i32 = 3;

    fn unit_m(&self) -> f64 {
        0.5 * self.table.acceleration_m_s2 * self.step_s * self.step_s
    }

    fn state(&self, [x, y, u, v]: Node) -> TranslationState {
        let position = Vector3::new(self.table.start[0], self.table.start[1], 0.0)
            + Vector3::new(f64::from(x), f64::from(y), 0.0) * self.unit_m();
        let velocity = Vector3::new(f64::from(u), f64::from(v), 0.0) * (self.table.acceleration_m_s2 * self.step_s);
        TranslationState { position, velocity }
    }

    fn is_free(&self, from: Node, push: [i32; 2]) -> bool {
        let start = self.state(from);
        let acceleration = Vector3::new(f64::from(push[0]), f64::from(push[1]), 0.0) * self.table.acceleration_m_s2;
        (0..=16).all(|k| {
            let time_s = f64::from(k) / 16.0 * self.step_s;
            let point = start.position + start.velocity * time_s + acceleration * (0.5 * time_s * time_s);
            // Between samples it moves by less than twice this.
            let slack_m = 3.0 * self.table.acceleration_m_s2 * self.step_s * self.step_s / 32.0;
            point.amax() <= self.table.half_m
                && self.table.world.nearest(self.table.radius_m, &point).distance_m >= slack_m
        })
    }

    /// Duration and nodes of a shortest one to rest in the goal region.
    fn shortest(&self) -> Option<Vec<Node>> {
        let mut before: BTreeMap<Node, Node> = BTreeMap::new();
        let origin = [0; 4];
        let mut ring = vec![origin];
        before.insert(origin, origin);
        let goal = Vector3::new(self.table.goal[0], self.table.goal[1], 0.0);
        while !ring.is_empty() {
            let mut next_ring = Vec::new();
            for node in ring {
                let state = self.state(node);
                if (state.position - goal).norm() <= self.table.goal_radius_m && node[2] == 0 && node[3] == 0 {
                    let mut path = vec![node];
                    while path[path.len() - 1] != origin {
                        path.push(before[&path[path.len() - 1]]);
                    }
                    path.reverse();
                    return Some(path);
                }
                for push in (-1..=1).flat_map(|a| (-1..=1).map(move |b| [a, b])) {
                    let [x, y, u, v] = node;
                    let next = [x + 2 * u + push[0], y + 2 * v + push[1], u + push[0], v + push[1]];
                    let is_slow = next[2].abs().max(next[3].abs()) <= Self::FASTEST;
                    if is_slow && !before.contains_key(&next) && self.is_free(node, push) {
                        before.insert(next, node);
                        next_ring.push(next);
                    }
                }
            }
            ring = next_ring;
        }
        None
    }
}

#[test]
fn is_never_above_the_best_motion_of_a_lattice() {
    let rooms: [Vec<AlignedBox>; 5] = [
        vec![block([-0.1, 0.1], [-9.0, 0.5])],
        vec![block([-0.1, 0.1], [-0.6, 0.6])],
        vec![block([-0.6, -0.4], [-9.0, 0.3]), block([0.3, 0.5], [-0.3, 9.0])],
        vec![block([-9.0, 0.5], [-0.1, 0.1]), block([0.7, 9.0], [-0.5, -0.3])],
        vec![],
    ];
    let mut shares = Vec::new();
    for solid in rooms {
        for (start, goal) in [([-0.8, -0.6], [0.8, -0.6]), ([-0.8, 0.7], [0.7, -0.8])] {
            let mut table = Table::new(solid.clone(), start, goal);
            (table.half_m, table.goal_radius_m, table.acceleration_m_s2) = (1.0, 0.1, 1.0);
            table.speed_m_s = [0.3 * f64::from(Lattice::FASTEST); 2];
            let lattice = Lattice { table: &table, step_s: 0.3 };
            let request = table.request();
            let bound = refined(&request, 4);
            let Some(path) = lattice.shortest() else {
                panic!("no motion on the lattice among {solid:?}");
            };
            let best_s = (path.len() - 1) as f64 * lattice.step_s;
            assert!(bound.least_duration_s() <= best_s, "{} > {best_s}", bound.least_duration_s());
            for (passed, node) in path.iter().enumerate() {
                let left_s = (path.len() - 1 - passed) as f64 * lattice.step_s;
                let least_s = bound.least_duration_from_s(&lattice.state(*node));
                assert!(least_s <= left_s + 1e-9, "{least_s} > {left_s} from {node:?}");
            }
            shares.push(bound.least_duration_s() / best_s);
        }
    }
    assert!(shares.iter().all(|share| *share > 0.5), "{shares:?}");
}

/// Walls of a labyrinth of `side` by `side` rooms of 1 m, corridors 0.4 m wide; a random tree of open doors.
fn labyrinth(side: usize, doors: &[bool]) -> Vec<AlignedBox> {
    let at = |k: usize| k as f64 - side as f64 / 2.0;
    let mut walls = Vec::new();
    // Posts, and walls between them where there is no door.
    for i in 0..=side {
        for j in 0..=side {
            let (x, y) = (at(i), at(j));
            walls.push(block([x - 0.3, x + 0.3], [y - 0.3, y + 0.3]));
            // A binary tree: each room opens to the east or to the north.
            let east_open = i > 0 && i < side && j < side && (j == side - 1 || doors[(i - 1) * side + j]);
            if j < side && !east_open {
                walls.push(block([x - 0.3, x + 0.3], [y + 0.3, y + 0.7]));
            }
            let north_open = j > 0 && j < side && i < side && (i == side - 1 || !doors[i * side + j - 1]);
            if i < side && !north_open {
                walls.push(block([x + 0.3, x + 0.7], [y - 0.3, y + 0.3]));
            }
        }
    }
    walls
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(6))]

    #[test]
    fn a_labyrinth_with_a_way_is_never_called_closed_and_a_closed_one_is(
        doors in prop::collection::vec(any::<bool>(), 25),
        radius_m in 0.05..0.19,
    ) {
        let side = 5;
        let mut table = Table::new(labyrinth(side, &doors), [-2.0, -2.0], [2.0, 2.0]);
        table.half_m = 2.5;
        table.radius_m = radius_m;
        {
            let request = table.request();
            let bound = refined(&request, 6);
            prop_assert!(!matches!(bound.reachability(), Reachability::Blocked(_)), "{:?}", bound.reachability());
            prop_assert!(bound.least_duration_s() <= 25.0);
            // 0.4 m of corridor leave at least 0.02 m; the finest cells have an edge of about 0.005 m.
            prop_assert_eq!(bound.reachability(), &Reachability::Reachable);
        }
        // Both doors of the goal's room are shut.
        let first = table.world.solid.len();
        table.world.solid.push(block([1.2, 1.8], [1.8, 2.2]));
        table.world.solid.push(block([1.8, 2.2], [1.2, 1.8]));
        let request = table.request();
        let bound = refined(&request, 6);
        prop_assert!(bound.least_duration_s().is_infinite());
        match bound.reachability() {
            Reachability::Blocked(Obstruction::Enclosed { blockers }) => {
                prop_assert!(blockers.iter().any(|blocker| matches!(blocker, Blocker::KeepOut(k) if *k >= first)));
            }
            other => prop_assert!(false, "{other:?}"),
        }
    }
}

/// Six plates of 0.1 m around the start.
fn shut_box() -> Vec<AlignedBox> {
    let mut plates = Vec::new();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut plate = solid([-1.1; 3], [1.1; 3]);
            let (near, far) = (side, side * 1.1);
            plate.lower_world[axis] = f64::min(near, far);
            plate.upper_world[axis] = f64::max(near, far);
            plates.push(plate);
        }
    }
    plates
}

/// A problem in space: from the origin to (2, 2, 2).
fn in_space<'a>(world: &'a Boxes, body: &'a f64, belief: &'a ModelBelief) -> GlobalRequest<'a, Boxes> {
    GlobalRequest {
        world,
        body,
        start: TranslationState::at_rest(Vector3::zeros()),
        attitude: UnitQuaternion::identity(),
        start_s: 0.0,
        goal: GoalRegion { position: Vector3::repeat(2.0), radius_m: 0.3, speed_m_s: 0.1, attitude: None },
        limits: MotionLimits {
            position: solid([-3.0; 3], [3.0; 3]),
            speed_m_s: Vector3::new(0.2, 0.3, 0.4),
            force_n: Vector3::repeat(0.1),
            torque_n_m: Vector3::zeros(),
            rate_rad_s: 0.0,
        },
        belief,
        objective: Objective::Duration,
        margin_m: 0.0,
        until: Until::FirstPlan,
        seed: 0,
    }
}

#[test]
fn a_shut_box_is_proven_shut_and_its_sides_are_named() {
    let (mut world, belief) = (Boxes::new(shut_box()), belief());
    // Something inside that is not part of the wall, and something far outside.
    world.solid.push(solid([0.3; 3], [0.6; 3]));
    world.solid.push(solid([-2.9; 3], [-2.5; 3]));
    let bound_is = |world: &Boxes, body: f64| {
        let request = in_space(world, &body, &belief);
        let bound = refined(&request, 5);
        (bound.reachability().clone(), bound.least_duration_s())
    };
    let sides: Vec<Blocker> = (0..6).map(Blocker::KeepOut).collect();
    let (reachability, least_s) = bound_is(&world, 0.1);
    assert_eq!(reachability, Reachability::Blocked(Obstruction::Enclosed { blockers: sides }));
    assert!(least_s.is_infinite());
    // One side out: there is a way.
    world.solid.remove(0);
    assert_eq!(bound_is(&world, 0.1).0, Reachability::Reachable);
}

#[test]
fn only_what_lasts_is_a_wall() {
    let belief = belief();
    let mut world = Boxes::new(Vec::new());
    world.leaving = Some((solid([1.0, -9.0, -9.0], [1.5, 9.0, 9.0]), 10.0));
    let request = in_space(&world, &0.1, &belief);
    let bound = refined(&request, 2);
    assert_eq!(bound.reachability(), &Reachability::Reachable);
    assert!(bound.least_duration_s().is_finite());
    // The leaving wall is in the way of a start inside it, however.
    let mut inside = request;
    inside.start.position.x = 1.2;
    assert!(matches!(diagnose(&inside).unwrap(), Some(Obstruction::StartBlocked { .. })));
    inside.start_s = 11.0;
    assert_eq!(diagnose(&inside).unwrap(), None);
}

#[test]
fn a_world_that_exaggerates_is_caught_by_the_exact_optimum() {
    let mut table = Table::new(vec![block([-0.2, 0.2], [-9.0, 2.0])], [-1.0, 0.0], [1.0, 0.0]);
    let exact_s = shortest_length_s(&table) + 1e-3;
    assert!(refined(&table.request(), 4).least_duration_s() <= exact_s);
    table.world.lie_m = 0.1;
    assert!(refined(&table.request(), 4).least_duration_s() > exact_s);
}

#[test]
fn a_spent_budget_leaves_the_bound_of_before() {
    let belief = belief();
    let world = Boxes::new(shut_box());
    let request = in_space(&world, &0.1, &belief);
    let mut bound = RouteBound::new(&request).unwrap();
    let unhindered_s = bound.least_duration_s();
    assert!(!bound.refine(&mut Units::new(3)).unwrap());
    assert_eq!(bound.least_duration_s().to_bits(), unhindered_s.to_bits());
    assert_eq!(bound.reachability(), &Reachability::Unknown);
    // x is the slowest: 1.7 m at 0.2 m/s; from rest to 0.2 m/s and down to 0.1 m/s at 0.05 m/s^2.
    let expected_s = 1.7 / 0.2 + 0.5 * 4.0 + 0.5 * 0.5 * 2.0;
    assert!((unhindered_s - expected_s).abs() < 1e-9, "{unhindered_s}");
}

#[test]
fn what_shows_at_once_is_diagnosed() {
    let belief = belief();
    let world = Boxes::new(vec![solid([1.0; 3], [3.0; 3])]);
    let request = in_space(&world, &0.1, &belief);
    assert!(matches!(
        diagnose(&request).unwrap(),
        Some(Obstruction::GoalBlocked { blocker: Blocker::KeepOut(0), clearance_m }) if (clearance_m + 1.1).abs() < 1e-12
    ));
    // Free in one corner: not certain, so not claimed.
    let slim = Boxes::new(vec![solid([1.0; 3], [2.05, 3.0, 3.0])]);
    assert_eq!(diagnose(&in_space(&slim, &0.1, &belief)).unwrap(), None);
    // Certain only cell by cell: the centre's own depth is less than the radius.
    let two = Boxes::new(vec![solid([1.0; 3], [2.05, 3.0, 3.0]), solid([1.9, 1.0, 1.0], [3.0; 3])]);
    assert!(matches!(diagnose(&in_space(&two, &0.1, &belief)).unwrap(), Some(Obstruction::GoalBlocked { .. })));
    let free = Boxes::new(Vec::new());
    let changed = |change: fn(&mut GlobalRequest<'_, Boxes>)| {
        let mut request = in_space(&free, &0.1, &belief);
        change(&mut request);
        diagnose(&request)
    };
    assert_eq!(changed(|_| ()).unwrap(), None);
    let small = |what, axis| Some(Obstruction::LimitTooSmall { what, axis, value: 0.0 });
    assert_eq!(changed(|request| request.limits.speed_m_s.y = 0.0).unwrap(), small("speed_m_s", 1));
    assert_eq!(changed(|request| request.limits.force_n.z = 0.0).unwrap(), small("force_n", 2));
    let outside = |answer| matches!(answer, Ok(Some(Obstruction::OutsideLimits { .. })));
    assert!(outside(changed(|request| request.start.position.x = 3.1)));
    assert!(outside(changed(|request| request.goal.position.y = 3.4)));
    assert!(outside(changed(|request| request.start.velocity.z = -0.5)));
    assert!(changed(|request| request.goal.radius_m = -1.0).is_err());
    assert!(changed(|request| request.start.position.x = f64::NAN).is_err());
    assert!(changed(|request| request.limits.position.upper_world.x = -4.0).is_err());
    assert!(changed(|request| request.limits.force_n.x = f64::INFINITY).is_err());
}

#[test]
fn the_least_impulse_is_what_the_start_velocity_needs() {
    let belief = belief();
    let free = Boxes::new(Vec::new());
    let mut request = in_space(&free, &0.1, &belief);
    request.objective = Objective::Impulse;
    request.start.velocity = Vector3::new(0.2, -0.3, 0.0);
    // The nearest velocity of norm 0.1 leaves, in the sum of components, 0.5 - 0.1 sqrt(2) m/s to be changed; 2 kg.
    let expected = 2.0 * (0.5 - 0.1 * f64::sqrt(2.0));
    let mut least = f64::INFINITY;
    for k in 0..3600 {
        let (sin, cos) = (f64::from(k) * 0.1).to_radians().sin_cos();
        least = least.min(2.0 * ((0.2 - 0.1 * cos).abs() + (-0.3 - 0.1 * sin).abs()));
    }
    let bound = RouteBound::new(&request).unwrap().lower_bound();
    assert!((bound - expected).abs() < 1e-9 && bound <= least && least < bound + 1e-4, "{bound} {least}");
}

#[test]
fn the_inscribed_ball_lies_inside_a_part() {
    let part = BodyEllipsoid {
        body_from_ellipsoid: Pose::from_parts(
            Vector3::new(0.05, -0.02, 0.03).into(),
            UnitQuaternion::from_euler_angles(0.3, -0.7, 1.1),
        ),
        semi_axes: Vector3::new(0.3, 0.15, 0.2),
    };
    let away = BodyEllipsoid {
        body_from_ellipsoid: Pose::from_parts(Vector3::new(1.0, 0.0, 0.0).into(), UnitQuaternion::identity()),
        semi_axes: Vector3::repeat(0.4),
    };
    let radius_m = BodyShape::try_new(vec![away, part]).unwrap().inscribed_radius_m();
    assert!(radius_m > 0.05 && radius_m <= 0.15);
    for k in 0..400 {
        let (polar, turn) = (f64::from(k) * 0.05, f64::from(k) * 2.4);
        let point = Vector3::new(polar.cos(), polar.sin() * turn.cos(), polar.sin() * turn.sin()) * radius_m;
        let inside = part.body_from_ellipsoid.inverse_transform_point(&point.into()).coords;
        assert!(inside.component_div(&part.semi_axes).norm() <= 1.0 + 1e-12);
    }
    assert!(BodyShape::try_new(vec![away]).unwrap().inscribed_radius_m() <= 0.0);
    assert!((BodyShape::sphere(0.16).unwrap().inscribed_radius_m() - 0.16).abs() < 1e-15);
}
