//! Nozzles: opening and area, thrust and wrench.

use super::constants::{
    AXIS_GROUPS, FLAP_CLOSED_RAD, FLAP_INTAKE_HEIGHT_M, FLAP_LENGTH_M, FLAP_TRAVEL_RAD, FLAPS_PER_NOZZLE,
    LEAK_AREAS_M2, NOZZLES, Nozzle,
};
use nalgebra::{SMatrix, SVector, Vector3};
use tumble_lie::Wrench;

/// One of the two propulsion modules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Module {
    /// Module 0, "PM1", on the +y side.
    Starboard,
    /// Module 1, "PM2", on the -y side.
    Port,
}

impl Module {
    /// Both, in the order of messages.
    pub const ALL: [Self; 2] = [Self::Starboard, Self::Port];

    /// Its six nozzles.
    pub fn nozzles(self) -> &'static [Nozzle; 6] {
        const STARBOARD: [Nozzle; 6] = [NOZZLES[0], NOZZLES[1], NOZZLES[2], NOZZLES[3], NOZZLES[4], NOZZLES[5]];
        const PORT: [Nozzle; 6] = [NOZZLES[6], NOZZLES[7], NOZZLES[8], NOZZLES[9], NOZZLES[10], NOZZLES[11]];
        match self {
            Self::Starboard => &STARBOARD,
            Self::Port => &PORT,
        }
    }

    /// The wrench about the body origin of its six thrusts, N.
    pub fn wrench_of_thrusts(self, thrusts_n: &[f64; 6]) -> Wrench<f64> {
        let [a, b, c, d, e, f, g, h, i, j, k, l] = WRENCH_PER_THRUST;
        match self {
            Self::Starboard => sum_of_wrenches(&[a, b, c, d, e, f], thrusts_n),
            Self::Port => sum_of_wrenches(&[g, h, i, j, k, l], thrusts_n),
        }
    }

    /// Its own leak area, m^2.
    pub fn leak_area_m2(self) -> f64 {
        let [starboard, port] = LEAK_AREAS_M2;
        match self {
            Self::Starboard => starboard,
            Self::Port => port,
        }
    }
}

impl Nozzle {
    /// Open area of both flaps at an angle from the closed stop, m^2.
    ///
    /// A closed flap leaves 1e-7 m^2 open.
    /// # Source
    /// (6.17), (6.18)
    pub fn area_m2(&self, opening_rad: f64) -> f64 {
        let height_m = FLAP_INTAKE_HEIGHT_M - FLAP_LENGTH_M * libm::cos(FLAP_CLOSED_RAD + opening_rad);
        FLAPS_PER_NOZZLE * self.width_m * height_m
    }

    /// Angle from the closed stop, rad, that opens this area; the nearer stop where no angle does.
    ///
    /// # Source
    /// (6.17), (6.18)
    pub fn opening_rad(&self, area_m2: f64) -> f64 {
        let height_m = area_m2 / (FLAPS_PER_NOZZLE * self.width_m);
        let cosine = (FLAP_INTAKE_HEIGHT_M - height_m) / FLAP_LENGTH_M;
        let angle_rad = libm::acos(cosine.clamp(-1.0, 1.0));
        (angle_rad - FLAP_CLOSED_RAD).clamp(0.0, FLAP_TRAVEL_RAD)
    }

    /// Thrust through an open area under a pressure, N.
    ///
    /// # Source
    /// (6.16)
    pub fn thrust_n(&self, area_m2: f64, pressure_pa: f64) -> f64 {
        2.0 * (self.discharge_coefficient * self.discharge_coefficient) * pressure_pa * area_m2
    }

    /// Open area that gives a thrust under a pressure, m^2.
    ///
    /// # Source
    /// (6.16)
    pub fn area_of_thrust_m2(&self, thrust_n: f64, pressure_pa: f64) -> f64 {
        thrust_n / (2.0 * (self.discharge_coefficient * self.discharge_coefficient) * pressure_pa)
    }

    /// Torque about the body origin, N m, and force, N, of one newton of thrust, which points against the outflow.
    pub(super) const fn wrench_per_thrust(&self) -> [f64; 6] {
        let ([px, py, pz], [ox, oy, oz]) = (self.position_body_m, self.outflow_body);
        [pz * oy - py * oz, px * oz - pz * ox, py * ox - px * oy, -ox, -oy, -oz]
    }
}

/// Column by column the wrench about the body origin per thrust.
const WRENCH_PER_THRUST: [[f64; 6]; 12] = {
    let mut columns = [[0.0; 6]; 12];
    let mut i = 0;
    while i < 12 {
        columns[i] = NOZZLES[i].wrench_per_thrust();
        i += 1;
    }
    columns
};

/// `B B^T` about the body origin, which is diagonal: the nozzles lie in opposed pairs.
const GRAM: [f64; 6] = {
    let mut sums = [0.0; 6];
    let mut i = 0;
    while i < 12 {
        let mut k = 0;
        while k < 6 {
            sums[k] += WRENCH_PER_THRUST[i][k] * WRENCH_PER_THRUST[i][k];
            k += 1;
        }
        i += 1;
    }
    sums
};

/// The values of both modules' nozzles in one.
pub(super) fn joined<T>([[a, b, c, d, e, f], [g, h, i, j, k, l]]: [[T; 6]; 2]) -> [T; 12] {
    [a, b, c, d, e, f, g, h, i, j, k, l]
}

/// The values of each module's nozzles.
pub(super) fn of_modules<T>([a, b, c, d, e, f, g, h, i, j, k, l]: [T; 12]) -> [[T; 6]; 2] {
    [[a, b, c, d, e, f], [g, h, i, j, k, l]]
}

/// The wrench about the body origin of twelve thrusts, N.
pub fn wrench_of_thrusts(thrusts_n: &[f64; 12]) -> Wrench<f64> {
    sum_of_wrenches(&WRENCH_PER_THRUST, thrusts_n)
}

fn sum_of_wrenches(wrench_per_thrust: &[[f64; 6]], thrusts_n: &[f64]) -> Wrench<f64> {
    let mut sum = [0.0; 6];
    for (column, thrust) in wrench_per_thrust.iter().zip(thrusts_n) {
        for (entry, per_thrust) in sum.iter_mut().zip(column) {
            *entry += per_thrust * thrust;
        }
    }
    let [tx, ty, tz, fx, fy, fz] = sum;
    Wrench::new(Vector3::new(tx, ty, tz), Vector3::new(fx, fy, fz))
}

/// The least thrusts, signed, N, that give a wrench about the body origin.
///
/// They do not depend on the centre of mass: moving the reference point multiplies `B` by an invertible matrix from the
/// left, and the pseudo-inverse of a matrix of full row rank is multiplied by its inverse from the right.
/// # Source
/// (6.14)
/// # Deviation
/// `pinv([R x D; D])` with the blocks one above the other, where (6.14) says side by side, and with `D` the direction of the
/// thrust, where its example shows that of the air; test `least_thrusts_are_those_of_the_pseudo_inverse`.
pub fn thrusts_of_wrench(wrench_body: &Wrench<f64>) -> [f64; 12] {
    let mut scaled = [0.0; 6];
    for ((entry, wanted), gram) in scaled.iter_mut().zip(&wrench_body.to_vector()).zip(GRAM) {
        *entry = wanted / gram;
    }
    WRENCH_PER_THRUST.map(|column| column.iter().zip(&scaled).map(|(a, b)| a * b).sum())
}

/// `B`: torque about a point and force per thrust.
///
/// # Shape
/// `[torque; force]` by nozzle.
pub fn thrusts_to_wrench(center_of_mass_body: &Vector3<f64>) -> SMatrix<f64, 6, 12> {
    let mut b = SMatrix::<f64, 6, 12>::from_columns(&WRENCH_PER_THRUST.map(SVector::from));
    for mut column in b.column_iter_mut() {
        let force = column.fixed_rows::<3>(3).into_owned();
        let mut torque = column.fixed_rows_mut::<3>(0);
        torque -= center_of_mass_body.cross(&force);
    }
    b
}

/// What is added to signed thrusts so that none is negative.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum PositivityShift {
    /// As flown: each axis group of four by its own most negative thrust.
    #[default]
    AxisGroups,
    /// As the thesis prints it: where any thrust is negative, the least of the twelve absolute values to all twelve.
    ///
    /// That leaves negative every thrust below minus the least absolute value; a nozzle cannot pull, stays shut, and the wrench
    /// is missed.
    Thesis,
}

impl PositivityShift {
    /// The thrusts after the shift. Equal thrust from the four nozzles of an axis cancels: the wrench stays.
    pub fn apply(self, thrusts_n: &[f64; 12]) -> [f64; 12] {
        let mut shifted = *thrusts_n;
        match self {
            Self::AxisGroups => {
                for group in AXIS_GROUPS {
                    let own = group.iter().filter_map(|i| thrusts_n.get(*i).copied());
                    let least = own.fold(0.0, f64::min);
                    for i in group {
                        if let Some(thrust) = shifted.get_mut(i) {
                            *thrust -= least;
                        }
                    }
                }
            }
            Self::Thesis => {
                if thrusts_n.iter().any(|thrust| *thrust < 0.0) {
                    let least = thrusts_n.iter().map(|thrust| thrust.abs()).fold(f64::INFINITY, f64::min);
                    for thrust in &mut shifted {
                        *thrust += least;
                    }
                }
            }
        }
        shifted
    }
}
