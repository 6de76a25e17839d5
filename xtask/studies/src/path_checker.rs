//! Judges plans by looking at them often: every millisecond, and at least at ten thousand times, unless told otherwise.
//!
//! Shares no code with the planners: polynomials, attitudes, the distance to ellipsoids and boxes and the limits are worked
//! out here from the plain numbers of the plan and of the world. Obstacles are taken to stand still.

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};
use tumble_dynamics::{AlignedBox, InertialParameters, World};
use tumble_planning::collision::BodyShape;
use tumble_planning::global::{GoalRegion, MotionLimits};
use tumble_planning::{ArcPath, BodyArc, TranslationState};

/// How often a plan is looked at.
#[derive(Clone, Copy, Debug)]
pub struct Sampling {
    pub step_s: f64,
    /// Fewest times, however short the plan is.
    pub least: usize,
}

const OFTEN: Sampling = Sampling { step_s: 1e-3, least: 10_000 };
/// Lengths and speeds below this are rounding, m and m/s.
const ROUNDING: f64 = 1e-9;

/// What a plan must keep to.
pub struct Rules<'a> {
    pub world: &'a World,
    pub body: &'a BodyShape,
    pub parameters: &'a InertialParameters<f64>,
    pub limits: &'a MotionLimits,
    pub start: TranslationState,
    pub attitude: UnitQuaternion<f64>,
    pub goal: &'a GoalRegion,
    pub margin_m: f64,
}

/// What is wrong with a plan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Findings {
    pub samples: usize,
    /// Samples at which the body is in something.
    pub in_obstacle: usize,
    /// The deepest a sphere was in anything, m.
    pub deepest_m: f64,
    /// Samples outside the limits of position, speed, force, rate or torque.
    pub over_limit: usize,
    /// Places where the motion jumps, the one before its start included.
    pub jumps: usize,
    /// Whether it ends elsewhere than in the goal region.
    pub misses_goal: bool,
}

impl Findings {
    pub fn is_clean(&self) -> bool {
        self.in_obstacle == 0 && self.over_limit == 0 && self.jumps == 0 && !self.misses_goal
    }
}

/// An ellipsoid, `|axes' (p - center)| / semi_axes` within one.
struct Solid {
    center: Vector3<f64>,
    axes: Matrix3<f64>,
    semi_axes: Vector3<f64>,
}

/// Ready to judge plans of one problem.
pub struct PathChecker<'a> {
    rules: Rules<'a>,
    ellipsoids: Vec<Solid>,
    forbidden: Vec<AlignedBox>,
    sampling: Sampling,
}

impl<'a> PathChecker<'a> {
    pub fn new(rules: Rules<'a>) -> Self {
        let ellipsoids = rules.world.obstacles.iter().map(|obstacle| Solid {
            center: obstacle.world_from_ellipsoid.translation.vector,
            axes: rotation(&obstacle.world_from_ellipsoid.rotation.coords.into()),
            semi_axes: obstacle.semi_axes,
        });
        let forbidden = forbidden_boxes(rules.world, rules.limits, reach(rules.body) + rules.margin_m);
        Self { ellipsoids: ellipsoids.collect(), forbidden, rules, sampling: OFTEN }
    }

    /// The same, looking as often as told.
    #[cfg(test)]
    pub fn sampled(self, sampling: Sampling) -> Self {
        Self { sampling, ..self }
    }

    pub fn check(&self, path: &ArcPath) -> Findings {
        let mut findings = Findings::default();
        let whole_s: f64 = path.arcs().iter().map(|arc| arc.duration_s).sum();
        let step_s = self.sampling.step_s.min(whole_s / self.sampling.least as f64);
        let mut reached = (self.rules.start.position, self.rules.start.velocity);
        let mut attitude = rotation(&self.rules.attitude.coords.into());
        for arc in path.arcs() {
            let [p, v, _] = position(arc, 0.0);
            let turned = (attitude - body_axes(arc, 0.0)).amax();
            let apart = (p - reached.0).amax().max((v - reached.1).amax()).max(turned);
            // a NaN is a jump
            findings.jumps += usize::from(apart.is_nan() || apart > ROUNDING);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let steps = (arc.duration_s / step_s).ceil().max(1.0) as usize;
            for step in 0..=steps {
                self.look(arc, arc.duration_s * step as f64 / steps as f64, &mut findings);
            }
            let [p, v, _] = position(arc, arc.duration_s);
            reached = (p, v);
            attitude = body_axes(arc, arc.duration_s);
        }
        let goal = self.rules.goal;
        let is_there = (reached.0 - goal.position).norm() <= goal.radius_m + ROUNDING
            && reached.1.norm() <= goal.speed_m_s + ROUNDING
            && goal.attitude.is_none_or(|wanted| (attitude - rotation(&wanted.coords.into())).amax() < 1e-6);
        findings.misses_goal = !is_there;
        findings
    }

    fn look(&self, arc: &BodyArc, time_s: f64, findings: &mut Findings) {
        findings.samples += 1;
        let [p, v, a] = position(arc, time_s);
        let Rules { limits, parameters, .. } = &self.rules;
        let inside = |axis: usize| {
            p[axis] >= limits.position.lower_world[axis] - ROUNDING
                && p[axis] <= limits.position.upper_world[axis] + ROUNDING
                && v[axis].abs() <= limits.speed_m_s[axis] + ROUNDING
                && parameters.mass * a[axis].abs() <= limits.force_n[axis] * (1.0 + 1e-9) + 1e-12
        };
        let [_, rate, rate_of_rate] = angle(arc, time_s);
        let turns = rate != 0.0 || rate_of_rate != 0.0;
        let is_turning_too_hard = turns && {
            let inertia = parameters.inertia_about_com();
            let axis = arc.axis_body.into_inner();
            let w = axis * rate;
            let torque = inertia * axis * rate_of_rate + w.cross(&(inertia * w));
            rate.abs() > limits.rate_rad_s * (1.0 + 1e-9) + 1e-12
                || (0..3).any(|axis| torque[axis].abs() > limits.torque_n_m[axis] * (1.0 + 1e-9) + 1e-12)
        };
        findings.over_limit += usize::from(!(0..3).all(inside) || is_turning_too_hard);

        let axes = body_axes(arc, time_s);
        let mut is_in_something = false;
        for part in self.rules.body.parts() {
            let center = p + axes * part.body_from_ellipsoid.translation.vector;
            let (least, largest) = (part.semi_axes.min(), part.semi_axes.max());
            if largest <= least {
                let depth_m = self.depth_of_sphere(&center, least + self.rules.margin_m);
                is_in_something |= depth_m.is_nan() || depth_m > ROUNDING;
                findings.deepest_m = findings.deepest_m.max(depth_m);
            } else {
                let part_axes = axes * rotation(&part.body_from_ellipsoid.rotation.coords.into());
                let grown = part.semi_axes.add_scalar(self.rules.margin_m);
                let solid = Solid { center, axes: part_axes, semi_axes: grown };
                is_in_something |= self.ellipsoids.iter().any(|other| overlap(&solid, other));
                is_in_something |= self.forbidden.iter().any(|other| {
                    let is_near = distance_to_box(&center, other) < grown.max();
                    is_near && gauge_of_box(&solid, other) < 1.0 - ROUNDING
                });
            }
        }
        findings.in_obstacle += usize::from(is_in_something);
    }

    /// How deep a sphere is in anything, m; negative where it is clear.
    fn depth_of_sphere(&self, center: &Vector3<f64>, radius_m: f64) -> f64 {
        let ellipsoids = self.ellipsoids.iter().map(|solid| distance_to_ellipsoid(center, solid, radius_m));
        let boxes = self.forbidden.iter().map(|solid| distance_to_box(center, solid));
        radius_m - ellipsoids.chain(boxes).fold(f64::INFINITY, f64::min)
    }
}

/// Value, slope and bend of the position, by Horner's rule on each derivative's own coefficients.
fn position(arc: &BodyArc, time_s: f64) -> [Vector3<f64>; 3] {
    let t = time_s;
    let c = &arc.position;
    [
        c[0] + (c[1] + (c[2] + (c[3] + (c[4] + c[5] * t) * t) * t) * t) * t,
        c[1] + (c[2] * 2.0 + (c[3] * 3.0 + (c[4] * 4.0 + c[5] * (5.0 * t)) * t) * t) * t,
        c[2] * 2.0 + (c[3] * 6.0 + (c[4] * 12.0 + c[5] * (20.0 * t)) * t) * t,
    ]
}

fn angle(arc: &BodyArc, time_s: f64) -> [f64; 3] {
    let t = time_s;
    let c = &arc.angle;
    [
        c[0] + (c[1] + (c[2] + (c[3] + (c[4] + c[5] * t) * t) * t) * t) * t,
        c[1] + (c[2] * 2.0 + (c[3] * 3.0 + (c[4] * 4.0 + c[5] * 5.0 * t) * t) * t) * t,
        c[2] * 2.0 + (c[3] * 6.0 + (c[4] * 12.0 + c[5] * 20.0 * t) * t) * t,
    ]
}

/// The rotation matrix of a quaternion `x, y, z, w`.
fn rotation(xyzw: &[f64; 4]) -> Matrix3<f64> {
    let [x, y, z, w] = *xyzw;
    Matrix3::new(
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - z * w),
        2.0 * (x * z + y * w),
        2.0 * (x * y + z * w),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - x * w),
        2.0 * (x * z - y * w),
        2.0 * (y * z + x * w),
        1.0 - 2.0 * (x * x + y * y),
    )
}

/// Body axes as columns, by Rodrigues' formula.
fn body_axes(arc: &BodyArc, time_s: f64) -> Matrix3<f64> {
    let start = rotation(&arc.attitude.coords.into());
    let [turned, _, _] = angle(arc, time_s);
    if turned == 0.0 {
        return start;
    }
    let (sin, cos) = turned.sin_cos();
    let k = arc.axis_body.into_inner();
    let cross = Matrix3::new(0.0, -k.z, k.y, k.z, 0.0, -k.x, -k.y, k.x, 0.0);
    start * (Matrix3::identity() + cross * sin + cross * cross * (1.0 - cos))
}

fn reach(body: &BodyShape) -> f64 {
    let reach =
        body.parts().iter().map(|part| part.body_from_ellipsoid.translation.vector.norm() + part.semi_axes.max());
    reach.fold(0.0, f64::max)
}

/// Signed distance of a point from an ellipsoid, m; a lower bound where that is above `enough_m`.
///
/// By bisection for the multiplier of the nearest point (Eberly, "Distance from a point to an ellipsoid").
fn distance_to_ellipsoid(point: &Vector3<f64>, solid: &Solid, enough_m: f64) -> f64 {
    let y = (solid.axes.transpose() * (point - solid.center)).map(|coordinate| coordinate.abs().max(1e-14));
    let e = solid.semi_axes;
    let gauge = y.component_div(&e).norm();
    let bound = (gauge - 1.0) * e.min();
    if bound > enough_m {
        return bound;
    }
    let least = e.imin();
    let square = e[least] * e[least];
    let excess = |t: f64| (0..3).map(|i| (e[i] * y[i] / (t + e[i] * e[i])).powi(2)).sum::<f64>() - 1.0;
    let (mut low, mut high) = (-square + e[least] * y[least], -square + e.component_mul(&y).norm());
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if excess(middle) > 0.0 { low = middle } else { high = middle }
    }
    let t = 0.5 * (low + high);
    let nearest = Vector3::from_fn(|i, _| e[i] * e[i] * y[i] / (t + e[i] * e[i]));
    (y - nearest).norm() * if gauge < 1.0 { -1.0 } else { 1.0 }
}

/// Signed distance of a point from a box, m.
fn distance_to_box(point: &Vector3<f64>, solid: &AlignedBox) -> f64 {
    let beyond = Vector3::from_fn(|i, _| (solid.lower_world[i] - point[i]).max(point[i] - solid.upper_world[i]));
    let outside = beyond.map(|value| value.max(0.0)).norm();
    if outside > 0.0 { outside } else { beyond.max() }
}

/// Whether two ellipsoids overlap by more than rounding: the largest value of the contact function of Perram and Wertheim,
/// `s (1 - s) r' ((1 - s) A + s B)^-1 r`, is below one. Golden section, for it is concave in `s`.
fn overlap(a: &Solid, b: &Solid) -> bool {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let r = b.center - a.center;
    if r.norm() > a.semi_axes.max() + b.semi_axes.max() {
        return false;
    }
    let shape = |solid: &Solid| {
        solid.axes * Matrix3::from_diagonal(&solid.semi_axes.component_mul(&solid.semi_axes)) * solid.axes.transpose()
    };
    let (a, b) = (shape(a), shape(b));
    let value = |s: f64| {
        let blend = a * (1.0 - s) + b * s;
        blend.try_inverse().map_or(0.0, |inverse| s * (1.0 - s) * r.dot(&(inverse * r)))
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..70 {
        let (left, right) = (high - GOLDEN * (high - low), low + GOLDEN * (high - low));
        let (at_left, at_right) = (value(left), value(right));
        if at_left.max(at_right) >= 1.0 - ROUNDING {
            return false;
        }
        if at_left > at_right { high = right } else { low = left }
    }
    true
}

/// The smallest `(x - c)' A^-1 (x - c)` over a box: below one where the ellipsoid reaches into it. Every face, edge and
/// corner is tried, as is the inside.
fn gauge_of_box(solid: &Solid, other: &AlignedBox) -> f64 {
    let inverse = solid.semi_axes.map(|semi_axis| 1.0 / (semi_axis * semi_axis));
    let form = solid.axes * Matrix3::from_diagonal(&inverse) * solid.axes.transpose();
    let (low, high) = (other.lower_world - solid.center, other.upper_world - solid.center);
    let mut best = f64::INFINITY;
    for code in 0..27_usize {
        let sides = [code % 3, code / 3 % 3, code / 9];
        // fixed coordinates; the free ones minimise the form: a 3 x 3 system with rows of the identity where fixed
        let mut matrix: SMatrix<f64, 3, 3> = form;
        let mut right = Vector3::zeros();
        for (axis, side) in sides.into_iter().enumerate() {
            if side > 0 {
                matrix.set_row(axis, &Matrix3::identity().row(axis));
                right[axis] = if side == 1 { low[axis] } else { high[axis] };
            }
        }
        if !right.iter().all(|value| value.is_finite()) {
            continue;
        }
        let Some(x) = matrix.try_inverse().map(|inverse| inverse * right) else { continue };
        let is_in_box = (0..3).all(|axis| x[axis] >= low[axis] - ROUNDING && x[axis] <= high[axis] + ROUNDING);
        if is_in_box {
            best = best.min(x.dot(&(form * x)));
        }
    }
    best
}

/// Keep-out boxes, and where keep-in boxes are given everything else near the limits, cut along all their sides.
fn forbidden_boxes(world: &World, limits: &MotionLimits, reach_m: f64) -> Vec<AlignedBox> {
    let mut forbidden = world.keep_out.clone();
    if world.keep_in.is_empty() {
        return forbidden;
    }
    let wider = Vector3::repeat(2.0 * reach_m + 0.1);
    let near = AlignedBox {
        lower_world: limits.position.lower_world - wider,
        upper_world: limits.position.upper_world + wider,
    };
    let cuts: Vec<Vec<f64>> = (0..3)
        .map(|axis| {
            let sides = world.keep_in.iter().flat_map(|b| [b.lower_world[axis], b.upper_world[axis]]);
            let (low, high) = (near.lower_world[axis], near.upper_world[axis]);
            let mut cuts: Vec<f64> = sides.filter(|side| *side > low && *side < high).chain([low, high]).collect();
            cuts.sort_by(f64::total_cmp);
            cuts
        })
        .collect();
    for x in cuts[0].windows(2) {
        for y in cuts[1].windows(2) {
            for z in cuts[2].windows(2) {
                let cell = AlignedBox::between(Vector3::new(x[0], y[0], z[0]), Vector3::new(x[1], y[1], z[1]));
                let middle = (cell.lower_world + cell.upper_world) * 0.5;
                if !world.keep_in.iter().any(|allowed| distance_to_box(&middle, allowed) <= 0.0) {
                    forbidden.push(cell);
                }
            }
        }
    }
    forbidden
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::SeedableRng;
    use tumble_dynamics::ObstacleEllipsoid;
    use tumble_planning::collision::BodyEllipsoid;

    use tumble_identification::noise::signed_unit;

    fn solid(rng: &mut ChaCha8Rng) -> Solid {
        let axes =
            UnitQuaternion::from_euler_angles(3.0 * signed_unit(rng), 3.0 * signed_unit(rng), 3.0 * signed_unit(rng));
        Solid {
            center: Vector3::from_fn(|_, _| signed_unit(rng)),
            axes: rotation(&axes.coords.into()),
            semi_axes: Vector3::from_fn(|_, _| 0.6 + 0.5 * signed_unit(rng)),
        }
    }

    fn surface(solid: &Solid, steps: u32) -> impl Iterator<Item = Vector3<f64>> + '_ {
        (0..=steps).flat_map(move |i| {
            (0..2 * steps).map(move |j| {
                let (polar, around) = (
                    f64::from(i) * std::f64::consts::PI / f64::from(steps),
                    f64::from(j) * std::f64::consts::PI / f64::from(steps),
                );
                let unit = Vector3::new(polar.sin() * around.cos(), polar.sin() * around.sin(), polar.cos());
                solid.center + solid.axes * unit.component_mul(&solid.semi_axes)
            })
        })
    }

    /// Against the nearest of many points on the surface, inside and outside.
    #[test]
    fn the_distance_to_an_ellipsoid_is_that_to_its_nearest_point() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..20 {
            let solid = solid(&mut rng);
            let point = Vector3::from_fn(|_, _| 1.5 * signed_unit(&mut rng));
            let found = distance_to_ellipsoid(&point, &solid, f64::INFINITY);
            let nearest = surface(&solid, 300).map(|p| (p - point).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest - found.abs() > -1e-12 && nearest - found.abs() < 1e-3, "{found} {nearest}");
            let y = solid.axes.transpose() * (point - solid.center);
            assert_eq!(found < 0.0, y.component_div(&solid.semi_axes).norm() < 1.0);
            assert!(distance_to_ellipsoid(&point, &solid, 0.0) <= found + 1e-12);
        }
    }

    /// Against points of one on the surface of the other, and a box against points of it.
    #[test]
    fn overlaps_are_those_of_points() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let (mut seen, mut boxed) = ([0, 0], [0, 0]);
        for _ in 0..60 {
            let (mut a, b) = (solid(&mut rng), solid(&mut rng));
            a.center *= 2.0;
            let least =
                surface(&a, 100).map(|p| distance_to_ellipsoid(&p, &b, f64::INFINITY)).fold(f64::INFINITY, f64::min);
            let contains = distance_to_ellipsoid(&b.center, &a, f64::INFINITY) < 0.0;
            if least.abs() > 1e-2 {
                assert_eq!(overlap(&a, &b), least < 0.0 || contains, "{least}");
                seen[usize::from(overlap(&a, &b))] += 1;
            }
            let corner = Vector3::from_fn(|_, _| 0.3 + 0.2 * signed_unit(&mut rng));
            let other = AlignedBox::between(b.center - corner, b.center + corner);
            let least = surface(&a, 100).map(|p| distance_to_box(&p, &other)).fold(f64::INFINITY, f64::min);
            if least.abs() > 1e-2 {
                let contains = distance_to_ellipsoid(&b.center, &a, f64::INFINITY) < 0.0;
                assert_eq!(gauge_of_box(&a, &other) < 1.0, least < 0.0 || contains, "{least}");
                boxed[usize::from(least < 0.0 || contains)] += 1;
            }
        }
        assert!(seen.iter().chain(&boxed).all(|count| *count >= 5), "{seen:?} {boxed:?}");
    }

    fn rules<'a>(world: &'a World, body: &'a BodyShape, limits: &'a MotionLimits, goal: &'a GoalRegion) -> Rules<'a> {
        static BODY: std::sync::OnceLock<InertialParameters<f64>> = std::sync::OnceLock::new();
        let parameters =
            BODY.get_or_init(|| InertialParameters::about_origin(2.0, Vector3::zeros(), Matrix3::identity()));
        let start = TranslationState::at_rest(Vector3::zeros());
        let attitude = UnitQuaternion::identity();
        Rules { world, body, parameters, limits, start, attitude, goal, margin_m: 0.0 }
    }

    /// One push of a metre along x, and each way in which it can be wrong.
    #[test]
    fn each_fault_of_a_path_is_seen() {
        let body = BodyShape::sphere(0.1).unwrap();
        let limits = MotionLimits {
            position: AlignedBox::between(Vector3::repeat(-2.0), Vector3::repeat(2.0)),
            speed_m_s: Vector3::repeat(1.0),
            force_n: Vector3::repeat(1.0),
            torque_n_m: Vector3::repeat(0.1),
            rate_rad_s: 0.1,
        };
        let goal = GoalRegion { position: Vector3::x(), radius_m: 0.01, speed_m_s: 1.0, attitude: None };
        let world = World::default();
        let start = TranslationState::at_rest(Vector3::zeros());
        let push = |duration_s: f64| {
            let acceleration = Vector3::new(0.5, 0.0, 0.0);
            ArcPath::new([BodyArc::accelerated(duration_s, &start, acceleration, UnitQuaternion::identity())])
        };
        let judge = |world: &World, limits: &MotionLimits, path: &ArcPath| {
            PathChecker::new(rules(world, &body, limits, &goal)).check(path)
        };
        let sound = judge(&world, &limits, &push(2.0));
        assert!(sound.is_clean() && sound.samples >= OFTEN.least, "{sound:?}");
        assert!(judge(&world, &limits, &push(1.9)).misses_goal);
        let slow = MotionLimits { speed_m_s: Vector3::repeat(0.999), ..limits };
        assert!(judge(&world, &slow, &push(2.0)).over_limit > 0);
        let weak = MotionLimits { force_n: Vector3::repeat(0.999), ..limits };
        assert!(judge(&world, &weak, &push(2.0)).over_limit > OFTEN.least);
        let narrow =
            MotionLimits { position: AlignedBox::between(Vector3::repeat(-2.0), Vector3::repeat(0.999)), ..limits };
        assert!(judge(&world, &narrow, &push(2.0)).over_limit > 0);
        let turned = push(2.0).arcs()[0].turning(Vector3::z_axis(), [0.0, 0.2, 0.0, 0.0, 0.0, 0.0]);
        assert!(judge(&world, &limits, &ArcPath::new([turned])).over_limit > 0);
        let mut tilted = push(2.0).arcs()[0];
        tilted.attitude = UnitQuaternion::from_euler_angles(0.0, 0.0, 1e-3);
        assert_eq!(judge(&world, &limits, &ArcPath::new([tilted])).jumps, 1);
        let twice = ArcPath::new(push(1.0).arcs().iter().chain(push(1.0).arcs()).copied());
        assert_eq!(judge(&world, &limits, &twice).jumps, 1);

        let at = |y: f64| World {
            obstacles: vec![ObstacleEllipsoid {
                world_from_ellipsoid: Isometry3::translation(0.5, y, 0.0),
                semi_axes: Vector3::new(0.01, 0.3, 0.2),
            }],
            ..World::default()
        };
        // it ends where the sphere, 0.1 m beside it, just touches
        assert_eq!(judge(&at(0.4001), &limits, &push(2.0)).in_obstacle, 0);
        let grazed = judge(&at(0.3999), &limits, &push(2.0));
        assert!(grazed.in_obstacle > 0 && (grazed.deepest_m - 1e-4).abs() < 1e-6, "{grazed:?}");
        // a bead through a sheet a fifth of a millimetre thick, far from both ends
        let sheet = World {
            obstacles: vec![ObstacleEllipsoid {
                world_from_ellipsoid: Isometry3::translation(0.5, 0.0, 0.0),
                semi_axes: Vector3::new(1e-4, 0.3, 0.2),
            }],
            ..World::default()
        };
        let bead = BodyShape::sphere(1e-4).unwrap();
        assert!(PathChecker::new(rules(&sheet, &bead, &limits, &goal)).check(&push(2.0)).in_obstacle > 0);
        let keep_in = |y: f64| World {
            keep_in: vec![
                AlignedBox::between(Vector3::new(-1.0, -0.5, -0.5), Vector3::new(0.5, y, 0.5)),
                AlignedBox::between(Vector3::new(0.5, -0.5, -0.5), Vector3::new(1.5, 0.5, 0.5)),
            ],
            ..World::default()
        };
        assert_eq!(judge(&keep_in(0.1), &limits, &push(2.0)).in_obstacle, 0);
        assert!(judge(&keep_in(0.0999), &limits, &push(2.0)).in_obstacle > 0);
        let door = World {
            keep_out: vec![AlignedBox::between(Vector3::new(0.4, 0.0999, 0.0), Vector3::repeat(0.5))],
            ..World::default()
        };
        assert!(judge(&door, &limits, &push(2.0)).in_obstacle > 0);

        // an ellipsoid that fits beside the door only one way round
        let plank = |long: Vector3<f64>| {
            let parts = vec![BodyEllipsoid { body_from_ellipsoid: Isometry3::identity(), semi_axes: long }];
            let body = BodyShape::try_new(parts).unwrap();
            PathChecker::new(rules(&door, &body, &limits, &goal)).check(&push(2.0)).in_obstacle
        };
        assert_eq!(plank(Vector3::new(0.3, 0.0998, 0.09)), 0);
        assert!(plank(Vector3::new(0.0998, 0.3, 0.09)) > 0);
    }
}
