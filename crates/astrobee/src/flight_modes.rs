//! Flight modes: gains of the controller, limits of the planner, tolerances of the monitor.
//!
//! Provenance: `config/worlds/{iss,granite,mgtf}.config`, nasa/astrobee 0.19.1.

use crate::propulsion::ImpellerMode;
use tumble_dynamics::nalgebra::Vector3;

/// Where the robot flies; each has its own gains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FlightSite {
    /// The station.
    Iss,
    /// The granite table: motion in x, y and yaw.
    Granite,
    /// The gantry.
    Mgtf,
}

/// Gains of the cascaded controller, each per body axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlGains {
    /// Attitude error (half-angle) to angular acceleration, 1/s^2.
    pub attitude_proportional: Vector3<f64>,
    /// Its integral, 1/s^3.
    pub attitude_integral: Vector3<f64>,
    /// Angular rate error to angular acceleration, 1/s.
    pub rate_damping: Vector3<f64>,
    /// Position error to acceleration, 1/s^2.
    pub position_proportional: Vector3<f64>,
    /// Its integral, 1/s^3.
    pub position_integral: Vector3<f64>,
    /// Velocity error to acceleration, 1/s; the nominal controller takes half of it.
    pub velocity_damping: Vector3<f64>,
}

impl ControlGains {
    /// Gains of a site; the same in all flight modes.
    pub fn of(site: FlightSite) -> Self {
        let all = Vector3::repeat;
        match site {
            FlightSite::Iss => Self {
                attitude_proportional: all(4.0),
                attitude_integral: all(0.002),
                rate_damping: all(3.2),
                position_proportional: all(0.6),
                position_integral: all(0.0001),
                velocity_damping: all(1.2),
            },
            FlightSite::Granite => Self {
                attitude_proportional: Vector3::new(0.0, 0.0, 4.0),
                attitude_integral: Vector3::new(0.0, 0.0, 0.002),
                rate_damping: Vector3::new(0.001, 0.001, 3.2),
                position_proportional: Vector3::new(0.6, 0.6, 0.0),
                position_integral: Vector3::new(0.0001, 0.0001, 0.0),
                velocity_damping: Vector3::new(1.2, 1.2, 0.001),
            },
            FlightSite::Mgtf => Self {
                attitude_proportional: all(2.0),
                attitude_integral: all(0.001),
                rate_damping: all(1.6),
                position_proportional: all(0.6),
                position_integral: all(0.0001),
                velocity_damping: all(1.2),
            },
        }
    }
}

/// A named way to fly.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum FlightMode {
    /// No control; what the robot starts in.
    Off,
    /// The usual one.
    #[default]
    Nominal,
    /// More thrust: payloads, disturbances.
    Difficult,
    /// Slow and silent.
    Quiet,
    /// Slow and tight: docking, perching.
    Precision,
}

/// What a flight mode asks of planner and monitor; the limits are of vector norms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlightLimits {
    /// Speed, m/s.
    pub speed_m_s: f64,
    /// Acceleration, m/s^2.
    pub acceleration_m_s2: f64,
    /// Angular rate, rad/s.
    pub rate_rad_s: f64,
    /// Angular acceleration, rad/s^2.
    pub angular_acceleration_rad_s2: f64,
    /// Largest distance from the reference under way, m.
    pub position_tolerance_m: f64,
    /// Largest angle from the reference under way, rad.
    pub attitude_tolerance_rad: f64,
}

/// Largest distance from the goal at its end, m.
pub const ENDPOINT_TOLERANCE_M: f64 = 0.1;
/// Largest lateness of a setpoint under way, s.
pub const TIME_TOLERANCE_S: f64 = 1.0;

impl FlightMode {
    /// All modes.
    pub const ALL: [Self; 5] = [Self::Off, Self::Nominal, Self::Difficult, Self::Quiet, Self::Precision];

    /// Name in the flight software.
    pub fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Nominal => "nominal",
            Self::Difficult => "difficult",
            Self::Quiet => "quiet",
            Self::Precision => "precision",
        }
    }

    /// How fast the impellers turn.
    pub fn impellers(self) -> ImpellerMode {
        match self {
            Self::Off => ImpellerMode::Off,
            Self::Nominal => ImpellerMode::Nominal,
            Self::Difficult | Self::Precision => ImpellerMode::Aggressive,
            Self::Quiet => ImpellerMode::Quiet,
        }
    }

    /// Its limits at a site.
    #[allow(clippy::approx_constant)] // the configured decimals, not the angles they round
    pub fn limits(self, site: FlightSite) -> FlightLimits {
        let [speed_m_s, acceleration_m_s2, rate_rad_s, angular_acceleration_rad_s2] = match (self, site) {
            (Self::Off, _) => [1.0, 1.0, 3.1415, 0.175],
            (Self::Nominal | Self::Precision, FlightSite::Mgtf) => [0.2, 0.02, 0.1745, 0.1745],
            (Self::Difficult, FlightSite::Mgtf) => [0.4, 0.04, 0.5236, 0.5236],
            (Self::Nominal, _) => [0.2, 0.0175, 0.1745, 0.1745],
            (Self::Difficult, _) => [0.4, 0.02, 0.5236, 0.25],
            (Self::Quiet, _) => [0.02, 0.002, 0.0174, 0.0174],
            (Self::Precision, _) => [0.02, 0.01, 0.1745, 0.1745],
        };
        let [position_tolerance_m, attitude_tolerance_rad] = match (self, site) {
            (Self::Nominal, FlightSite::Granite) => [0.2, 0.3491],
            (Self::Nominal, _) => [0.25, 0.3491],
            (Self::Difficult, _) => [0.2, 0.3490],
            (Self::Off | Self::Quiet | Self::Precision, _) => [0.1, 0.1745],
        };
        FlightLimits {
            speed_m_s,
            acceleration_m_s2,
            rate_rad_s,
            angular_acceleration_rad_s2,
            position_tolerance_m,
            attitude_tolerance_rad,
        }
    }
}

impl FlightLimits {
    /// The limits when the robot need not face where it flies: both accelerations halved.
    #[must_use]
    pub fn without_face_forward(self) -> Self {
        Self {
            acceleration_m_s2: 0.5 * self.acceleration_m_s2,
            angular_acceleration_rad_s2: 0.5 * self.angular_acceleration_rad_s2,
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::BodyConfiguration;

    #[test]
    #[allow(clippy::float_cmp)] // copies
    fn limits_follow_site_and_facing() {
        let iss = FlightMode::Nominal.limits(FlightSite::Iss);
        assert_eq!([iss.position_tolerance_m, iss.attitude_tolerance_rad], [0.25, 0.3491]);
        assert_eq!(FlightMode::Nominal.limits(FlightSite::Granite).position_tolerance_m, 0.2);
        assert_eq!(FlightMode::Difficult.limits(FlightSite::Mgtf).acceleration_m_s2, 0.04);
        assert_eq!(FlightMode::Precision.limits(FlightSite::Mgtf).speed_m_s, 0.2);
        let sideways = iss.without_face_forward();
        assert_eq!(sideways.acceleration_m_s2, 0.008_75);
        assert_eq!(sideways.angular_acceleration_rad_s2, 0.087_25);
        assert_eq!(sideways.speed_m_s, iss.speed_m_s);
        for mode in FlightMode::ALL {
            assert_eq!(mode.impellers() == ImpellerMode::Off, mode == FlightMode::Off, "{}", mode.name());
        }
    }

    #[test]
    fn the_nominal_acceleration_asks_for_0_168_newton() {
        let (body, limits) = (BodyConfiguration::Iss.parameters(), FlightMode::Nominal.limits(FlightSite::Iss));
        assert!((body.mass * limits.acceleration_m_s2 - 0.168).abs() < 5e-4);
        let torque = body.inertia_about_com()[(2, 2)] * limits.angular_acceleration_rad_s2;
        assert!((torque - 0.0283).abs() < 5e-5);
    }
}
