//! The blower: how much pressure an impeller holds in its plenum against the area through which the air leaves.
//!
//! With the flow coefficient `q`, the pressure coefficient is a polynomial `Cp(q)` and the pressure
//! `dP = rho N^2 d^2 Cp`. Flight software knows the curve as tables over `q = 0, 0.001, ...`, linear in between: over the
//! open area for the hardware, over thrust for the allocation. Both are made from the polynomial by the compiler.

use super::constants::{AIR_DENSITY_KG_M3, IMPELLER_DIAMETER_M, IMPELLER_HEIGHT_M, LEAK_AREAS_M2, PRESSURE_POLYNOMIAL};

/// Points of the curve: `q` from 0 to 0.333.
pub const POINTS: usize = 334;
/// Points up to the largest thrust, where the allocation's table ends: `q` from 0 to 0.315.
pub const THRUST_POINTS: usize = 316;
const FLOW_COEFFICIENT_STEP: f64 = 0.001;

/// Leak area that the allocation takes for both modules, m^2.
pub const ALLOCATED_LEAK_AREA_M2: f64 = LEAK_AREAS_M2[0];

/// `T / N^2` of an open area (without leak) of 1 m^2 at pressure coefficient one: `2 rho d^2`.
const THRUST_PER_AREA: f64 = 2.0 * AIR_DENSITY_KG_M3 * IMPELLER_DIAMETER_M * IMPELLER_DIAMETER_M;

/// One point of the curve.
#[derive(Clone, Copy, Debug)]
struct Point {
    /// Leak area plus discharge coefficient times open area of each nozzle, m^2.
    area_m2: f64,
    /// Sum of thrust over discharge coefficient, over the square of the speed, N s^2.
    thrust: f64,
    pressure_coefficient: f64,
}

static CURVE: [Point; POINTS] = curve();

/// The largest `T / N^2` that the allocation's table holds, N s^2.
pub const LARGEST_THRUST_RATIO: f64 = curve()[THRUST_POINTS - 1].thrust;
/// The area at the largest thrust, leak included, m^2: there the thesis's table ends.
pub const AREA_AT_LARGEST_THRUST_M2: f64 = curve()[THRUST_POINTS - 1].area_m2;

const fn curve() -> [Point; POINTS] {
    let mut points = [Point { area_m2: 0.0, thrust: 0.0, pressure_coefficient: 0.0 }; POINTS];
    let mut i = 0;
    while i < POINTS {
        #[allow(clippy::cast_precision_loss)]
        let q = i as f64 * FLOW_COEFFICIENT_STEP;
        let pressure_coefficient = pressure_coefficient(q);
        let area_m2 = q * IMPELLER_DIAMETER_M * IMPELLER_HEIGHT_M / square_root(2.0 * pressure_coefficient);
        let thrust = THRUST_PER_AREA * pressure_coefficient * (area_m2 - ALLOCATED_LEAK_AREA_M2);
        points[i] = Point { area_m2, thrust, pressure_coefficient };
        i += 1;
    }
    points
}

/// The impeller's pressure coefficient at a flow coefficient, from its characteristic.
pub const fn pressure_coefficient(flow_coefficient: f64) -> f64 {
    let [a, b, c, d, e, f] = PRESSURE_POLYNOMIAL;
    let q = flow_coefficient;
    a + q * (b + q * (c + q * (d + q * (e + q * f))))
}

/// Newton's iteration, since the compiler has no root for constants; the arguments lie in 0.01 to 0.17.
const fn square_root(x: f64) -> f64 {
    let mut root = 0.5;
    let mut i = 0;
    while i < 10 {
        root = 0.5 * (root + x / root);
        i += 1;
    }
    root
}

/// Pressure that an impeller holds, Pa.
///
/// # Source
/// (6.15)
pub fn pressure_pa(speed_rad_s: f64, pressure_coefficient: f64) -> f64 {
    AIR_DENSITY_KG_M3 * (speed_rad_s * speed_rad_s) * (IMPELLER_DIAMETER_M * IMPELLER_DIAMETER_M) * pressure_coefficient
}

/// The pressure coefficient at an effective area, m^2: leak area plus discharge coefficient times open area of each nozzle.
///
/// Linear between the points, held constant beyond the last.
pub fn pressure_coefficient_of_area(area_m2: f64) -> f64 {
    let (low, high) = segment(&CURVE, |point| point.area_m2, area_m2);
    interpolate((low.area_m2, high.area_m2), (low.pressure_coefficient, high.pressure_coefficient), area_m2)
}

/// The pressure coefficient at which a module gives a thrust: `T / N^2` with `T` the sum of thrust over discharge
/// coefficient, N s^2.
///
/// Linear between the points, held constant beyond the ends; the leak area is [`ALLOCATED_LEAK_AREA_M2`].
/// # Source
/// (6.19), (6.20)
pub fn pressure_coefficient_of_thrust(thrust_over_speed_squared: f64) -> f64 {
    let (low, high) = segment(&CURVE[..THRUST_POINTS], |point| point.thrust, thrust_over_speed_squared);
    let pressures = (low.pressure_coefficient, high.pressure_coefficient);
    interpolate((low.thrust, high.thrust), pressures, thrust_over_speed_squared)
}

/// The pressure coefficient at which [`pressure_coefficient_of_thrust`] opens its nozzles this far.
///
/// It passes through the points of [`pressure_coefficient_of_area`] and differs in between, where that is linear in area
/// and this in thrust. Past the largest thrust, where the allocation never goes, the two are the same.
pub fn pressure_coefficient_as_allocated(area_m2: f64) -> f64 {
    let (low, high) = segment(&CURVE, |point| point.area_m2, area_m2);
    if area_m2 >= AREA_AT_LARGEST_THRUST_M2 {
        return pressure_coefficient_of_area(area_m2);
    }
    // Cp = Cp0 + slope (thrust - thrust0) with thrust = Cp THRUST_PER_AREA (area - leak), solved for Cp
    let slope = (high.pressure_coefficient - low.pressure_coefficient) / (high.thrust - low.thrust);
    (low.pressure_coefficient - slope * low.thrust)
        / (1.0 - slope * THRUST_PER_AREA * (area_m2 - ALLOCATED_LEAK_AREA_M2))
}

/// The two neighbours of a value; the outermost two beyond the ends.
fn segment(points: &[Point], of: impl Fn(&Point) -> f64, value: f64) -> (Point, Point) {
    let above = points.partition_point(|point| of(point) <= value).clamp(1, points.len() - 1);
    (points[above - 1], points[above])
}

/// On the line through two points, held constant beyond them.
fn interpolate((x0, x1): (f64, f64), (y0, y1): (f64, f64), x: f64) -> f64 {
    let share = ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
    y0 + share * (y1 - y0)
}
