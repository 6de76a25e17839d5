//! What the messages say: NASA's Astrobee messages and the common ones of ROS, from ROS 1 and from CDR.

use super::raw_message::{Encoding, RawMessage};
use super::wire::{Field, Wire, WireError};
use tumble_dynamics::nalgebra::{Quaternion, Vector3};

/// Why a message of a known type is not decoded.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MessageError {
    /// A definition that differs from those known: read with another field list it would be nonsense.
    #[error("{type_name} has the unknown definition {md5}; known: {}", known.join(", "))]
    UnknownDefinition {
        /// `package/Name`.
        type_name: &'static str,
        /// md5 sum found.
        md5: String,
        /// md5 sums that can be read.
        known: &'static [&'static str],
    },
    /// A payload that does not hold the fields.
    #[error("{type_name}: {source}")]
    Payload {
        /// `package/Name`.
        type_name: &'static str,
        /// What is wrong.
        source: WireError,
    },
}

/// A structure as the list of its fields, in the order of the definition.
macro_rules! fields {
    ($(#[$doc:meta])* $name:ident $(<$life:lifetime>)? { $($(#[$field_doc:meta])* $field:ident: $type:ty,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name $(<$life>)? {
            $($(#[$field_doc])* pub $field: $type,)*
        }
        impl<'a> Field<'a> for fields!(@of $name $(<$life>)?) {
            const LEAST_BYTES: usize = 0 $(+ <$type as Field<'a>>::LEAST_BYTES)*;
            fn read(wire: &mut Wire<'a>) -> Result<Self, WireError> {
                Ok(Self { $($field: Field::read(wire)?,)* })
            }
        }
    };
    (@of $name:ident) => { $name };
    (@of $name:ident <$life:lifetime>) => { $name<'a> };
}

/// When and in which frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header<'a> {
    /// Running number, ROS 1 only.
    pub sequence: Option<u32>,
    /// Time stamp, ns.
    pub stamp_ns: i64,
    /// Frame in which the message speaks.
    pub frame_id: &'a str,
}

impl<'a> Field<'a> for Header<'a> {
    const LEAST_BYTES: usize = 12;
    fn read(wire: &mut Wire<'a>) -> Result<Self, WireError> {
        let sequence = if wire.is_ros1() { Some(u32::read(wire)?) } else { None };
        // Unsigned in ROS 1, signed in ROS 2.
        let seconds = if wire.is_ros1() { i64::from(u32::read(wire)?) } else { i64::from(i32::read(wire)?) };
        let nanoseconds = i64::from(u32::read(wire)?);
        Ok(Self { sequence, stamp_ns: seconds * 1_000_000_000 + nanoseconds, frame_id: Field::read(wire)? })
    }
}

fields! {
    /// `geometry_msgs/Pose`.
    Pose {
        /// Of the frame's origin, m.
        position: Vector3<f64>,
        /// From the frame's axes to those of the header, as recorded.
        orientation: Quaternion<f64>,
    }
}
fields! {
    /// `geometry_msgs/Twist`.
    Twist {
        /// m/s.
        linear: Vector3<f64>,
        /// rad/s.
        angular: Vector3<f64>,
    }
}
fields! {
    /// `geometry_msgs/Wrench`; the one place where the force comes first.
    WrenchMessage {
        /// N.
        force: Vector3<f64>,
        /// N m.
        torque: Vector3<f64>,
    }
}
fields! {
    /// `ff_msgs/EkfState`: the localisation's estimate.
    EkfState<'a> {
        /// Time; frame `world`.
        header: Header<'a>,
        /// `body`.
        child_frame_id: &'a str,
        /// Of the body, world axes.
        pose: Pose,
        /// Of the body origin, world axes, m/s.
        velocity: Vector3<f64>,
        /// Filtered rate less its bias, body axes, rad/s.
        omega: Vector3<f64>,
        /// rad/s.
        gyro_bias: Vector3<f64>,
        /// Filtered, bias, gravity and centripetal lever-arm term removed, body axes, m/s^2.
        accel: Vector3<f64>,
        /// m/s^2.
        accel_bias: Vector3<f64>,
        /// Orientation, gyro bias, velocity, accelerometer bias, position: three variances each.
        cov_diag: [f32; 15],
        /// 0 good, 1 poor, 2 lost.
        confidence: u8,
        /// Which clones are augmented.
        aug_state_enum: u8,
        /// 255 invalid.
        status: u8,
        /// Optical-flow features.
        of_count: u8,
        /// Landmarks.
        ml_count: u8,
        /// Of a handrail.
        hr_global_pose: Pose,
        /// Mahalanobis distances of the landmarks.
        ml_mahal_dists: [f32; 50],
        /// Whether the bias is being initialised.
        estimating_bias: bool,
    }
}
fields! {
    /// `ff_msgs/FamCommand`: what the controller asks of the force allocation.
    FamCommand<'a> {
        /// Frame `body`.
        header: Header<'a>,
        /// About the centre of mass that the robot believes in, body axes.
        wrench: WrenchMessage,
        /// m/s^2.
        accel: Vector3<f64>,
        /// rad/s^2.
        alpha: Vector3<f64>,
        /// Of the controller.
        status: u8,
        /// World axes, m.
        position_error: Vector3<f64>,
        /// m s.
        position_error_integrated: Vector3<f64>,
        /// Vector part of the error quaternion.
        attitude_error: Vector3<f64>,
        /// Its integral.
        attitude_error_integrated: Vector3<f64>,
        /// rad.
        attitude_error_mag: f32,
        /// 0 idle, 1 stop, 2 nominal.
        control_mode: u8,
    }
}
/// What one propulsion module is told: `ff_hw_msgs/PmcGoal`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PmcGoal {
    /// Impeller, counts.
    pub motor_speed: u8,
    /// Nozzles, counts.
    pub nozzle_positions: [u8; 6],
}
impl Field<'_> for PmcGoal {
    const LEAST_BYTES: usize = 7;
    fn read(wire: &mut Wire<'_>) -> Result<Self, WireError> {
        Ok(Self { motor_speed: Field::read(wire)?, nozzle_positions: Field::read(wire)? })
    }
}
fields! {
    /// `ff_hw_msgs/PmcCommand`: what both propulsion modules are told.
    PmcCommand<'a> {
        /// Time.
        header: Header<'a>,
        /// Module 0 is starboard.
        goals: Vec<PmcGoal>,
    }
}
fields! {
    /// `ff_hw_msgs/PmcStatus`: what one propulsion module says.
    PmcStatus {
        /// Impeller, counts.
        motor_speed: u8,
        /// Counts.
        motor_current: u8,
        /// Of the 6 V supply, counts.
        v6_current: u8,
        /// Counts.
        pressure: u16,
        /// Seven on the robot.
        temperatures: Vec<u8>,
        /// Flags.
        status_1: u8,
        /// Flags.
        status_2: u8,
        /// Which command this answers.
        command_id: u8,
    }
}
fields! {
    /// `ff_hw_msgs/PmcTelemetry`: what both propulsion modules say.
    PmcTelemetry<'a> {
        /// Time.
        header: Header<'a>,
        /// Module 0 is starboard.
        statuses: Vec<PmcStatus>,
    }
}
fields! {
    /// `geometry_msgs/InertiaStamped`: the body that the robot believes in.
    InertiaStamped<'a> {
        /// Frame of centre of mass and inertia.
        header: Header<'a>,
        /// kg.
        mass: f64,
        /// m.
        center_of_mass: Vector3<f64>,
        /// `ixx, ixy, ixz, iyy, iyz, izz` about the centre of mass, kg m^2.
        inertia: [f64; 6],
    }
}
fields! {
    /// `sensor_msgs/Imu`, sensor axes.
    Imu<'a> {
        /// Frame of the sensor.
        header: Header<'a>,
        /// Not every sensor knows it.
        orientation: Quaternion<f64>,
        /// First element -1: there is no orientation.
        orientation_covariance: [f64; 9],
        /// rad/s.
        angular_velocity: Vector3<f64>,
        /// First element -1: there is no rate.
        angular_velocity_covariance: [f64; 9],
        /// m/s^2.
        linear_acceleration: Vector3<f64>,
        /// First element -1: there is no acceleration.
        linear_acceleration_covariance: [f64; 9],
    }
}
fields! {
    /// `geometry_msgs/PoseStamped`.
    PoseStamped<'a> {
        /// Time and frame.
        header: Header<'a>,
        /// In that frame.
        pose: Pose,
    }
}
fields! {
    /// `geometry_msgs/TwistStamped`.
    TwistStamped<'a> {
        /// Time and frame.
        header: Header<'a>,
        /// In that frame.
        twist: Twist,
    }
}
fields! {
    /// `geometry_msgs/WrenchStamped`.
    WrenchStamped<'a> {
        /// Time and frame.
        header: Header<'a>,
        /// In that frame.
        wrench: WrenchMessage,
    }
}
fields! {
    /// `nav_msgs/Odometry`.
    Odometry<'a> {
        /// Time and frame of the pose.
        header: Header<'a>,
        /// Frame of the twist.
        child_frame_id: &'a str,
        /// In the header's frame.
        pose: Pose,
        /// Row by row, position first.
        pose_covariance: [f64; 36],
        /// In the child frame.
        twist: Twist,
        /// Row by row, linear first.
        twist_covariance: [f64; 36],
    }
}

/// `ff_msgs/FlightMode`: gains, tolerances and limits.
#[derive(Clone, Debug, PartialEq)]
pub struct FlightMode<'a> {
    /// Time.
    pub header: Header<'a>,
    /// Such as `nominal`.
    pub name: &'a str,
    /// Whether the controller runs.
    pub control_enabled: bool,
    /// m; until version 0.16.2.
    pub collision_radius: Option<f32>,
    /// m; from version 0.15.2 on.
    pub tolerance_pos_endpoint: Option<f32>,
    /// Position, velocity, attitude, rate, time: m, m/s, rad, rad/s, s.
    pub tolerances: [f32; 5],
    /// Attitude, proportional.
    pub att_kp: Vector3<f64>,
    /// Attitude, integral.
    pub att_ki: Vector3<f64>,
    /// Rate.
    pub omega_kd: Vector3<f64>,
    /// Position, proportional.
    pub pos_kp: Vector3<f64>,
    /// Position, integral.
    pub pos_ki: Vector3<f64>,
    /// Velocity.
    pub vel_kd: Vector3<f64>,
    /// Velocity, acceleration, rate, angular acceleration: m/s, m/s^2, rad/s, rad/s^2.
    pub hard_limits: [f32; 4],
    /// Number of the impeller mode.
    pub speed: u8,
}

impl<'a> FlightMode<'a> {
    fn read(wire: &mut Wire<'a>, radius: bool, endpoint: bool) -> Result<Self, WireError> {
        Ok(Self {
            header: Field::read(wire)?,
            name: Field::read(wire)?,
            control_enabled: Field::read(wire)?,
            collision_radius: if radius { Some(f32::read(wire)?) } else { None },
            tolerance_pos_endpoint: if endpoint { Some(f32::read(wire)?) } else { None },
            tolerances: Field::read(wire)?,
            att_kp: Field::read(wire)?,
            att_ki: Field::read(wire)?,
            omega_kd: Field::read(wire)?,
            pos_kp: Field::read(wire)?,
            pos_ki: Field::read(wire)?,
            vel_kd: Field::read(wire)?,
            hard_limits: Field::read(wire)?,
            speed: Field::read(wire)?,
        })
    }
}

/// md5 sums of `ff_msgs/FlightMode`: to v0.15.1; v0.15.2 to v0.16.2; from v0.16.3 on.
const FLIGHT_MODES: [&str; 3] =
    ["21af9f940eeb9407d4d58829e8cfc200", "64fef5727fd56589af93ac307057592a", "0bb389101a5f30087bd644e6596d8e8e"];

/// The types that are decoded, each with the md5 sums of its definitions in ROS 1.
pub const KNOWN: [(&str, &[&str]); 11] = [
    ("ff_msgs/EkfState", &["543b97822b033d7199b506ad4005f134"]),
    ("ff_msgs/FamCommand", &["baf174131dee1a8b03d9d5feac8aa809"]),
    ("ff_hw_msgs/PmcCommand", &["8083cc589ac2164cf53110420a56afbd"]),
    ("ff_hw_msgs/PmcTelemetry", &["a2c2effcfbf47c9a5536cf2c22e8acb6"]),
    ("ff_msgs/FlightMode", &FLIGHT_MODES),
    ("geometry_msgs/InertiaStamped", &["ddee48caeab5a966c5e8d166654a9ac7"]),
    ("sensor_msgs/Imu", &["6a62c6daae103f4ff57a132d6f95cec2"]),
    ("geometry_msgs/PoseStamped", &["d3812c3cbc69362b77dc0b19b345f8f5"]),
    ("geometry_msgs/TwistStamped", &["98d34b0043a2093cf9d9345ab6eef12e"]),
    ("geometry_msgs/WrenchStamped", &["d78d3cb249ce23087ade7e7d0c40cfa7"]),
    ("nav_msgs/Odometry", &["cd5e73d190d741a2f92e81eda573aca7"]),
];

/// A decoded message.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
#[non_exhaustive]
pub enum Message<'a> {
    EkfState(Box<EkfState<'a>>),
    FamCommand(FamCommand<'a>),
    PmcCommand(PmcCommand<'a>),
    PmcTelemetry(PmcTelemetry<'a>),
    FlightMode(FlightMode<'a>),
    InertiaStamped(InertiaStamped<'a>),
    Imu(Imu<'a>),
    PoseStamped(PoseStamped<'a>),
    TwistStamped(TwistStamped<'a>),
    WrenchStamped(WrenchStamped<'a>),
    Odometry(Box<Odometry<'a>>),
}

impl<'a> Message<'a> {
    /// When it was measured or commanded, and in which frame.
    pub fn header(&self) -> &Header<'a> {
        match self {
            Self::EkfState(m) => &m.header,
            Self::FamCommand(m) => &m.header,
            Self::PmcCommand(m) => &m.header,
            Self::PmcTelemetry(m) => &m.header,
            Self::FlightMode(m) => &m.header,
            Self::InertiaStamped(m) => &m.header,
            Self::Imu(m) => &m.header,
            Self::PoseStamped(m) => &m.header,
            Self::TwistStamped(m) => &m.header,
            Self::WrenchStamped(m) => &m.header,
            Self::Odometry(m) => &m.header,
        }
    }
}

/// Decodes a message of a known type; `None` for every other type and for encodings without a field layout.
///
/// A message of ROS 1 is told by type and md5 sum, one of ROS 2 (and of ROS 1 where the recording keeps no sum) by the type
/// alone: then the newest definition must fit the payload to the byte. (That does not tell the oldest `FlightMode` from the
/// newest, which has another tolerance at the place of the collision radius.)
///
/// # Errors
/// [`MessageError`] for an unknown definition or a payload that does not hold the fields.
pub fn decode<'a>(raw: &RawMessage<'a>) -> Option<Result<Message<'a>, MessageError>> {
    if !matches!(raw.encoding, Encoding::Ros1 | Encoding::Cdr) {
        return None;
    }
    let (type_name, known) = *KNOWN.iter().find(|(type_name, _)| *type_name == raw.type_name)?;
    let told = raw.encoding == Encoding::Ros1 && !raw.md5.is_empty();
    if told && !known.contains(&raw.md5) {
        return Some(Err(MessageError::UnknownDefinition { type_name, md5: shown(raw.md5), known }));
    }
    Some(payload(raw, type_name).map_err(|source| MessageError::Payload { type_name, source }))
}

/// What may go to a terminal of a text that should be an md5 sum.
fn shown(md5: &str) -> String {
    md5.chars().map(|c| if c.is_control() { '\u{fffd}' } else { c }).take(40).collect()
}

fn payload<'a>(raw: &RawMessage<'a>, type_name: &str) -> Result<Message<'a>, WireError> {
    let mut wire = Wire::new(raw.encoding, raw.payload)?;
    let w = &mut wire;
    let message = match type_name {
        "ff_msgs/EkfState" => Message::EkfState(Box::new(Field::read(w)?)),
        "ff_msgs/FamCommand" => Message::FamCommand(Field::read(w)?),
        "ff_hw_msgs/PmcCommand" => Message::PmcCommand(Field::read(w)?),
        "ff_hw_msgs/PmcTelemetry" => Message::PmcTelemetry(Field::read(w)?),
        "ff_msgs/FlightMode" => {
            let [oldest, older, _] = FLIGHT_MODES;
            Message::FlightMode(FlightMode::read(w, raw.md5 == oldest || raw.md5 == older, raw.md5 != oldest)?)
        }
        "geometry_msgs/InertiaStamped" => Message::InertiaStamped(Field::read(w)?),
        "sensor_msgs/Imu" => Message::Imu(Field::read(w)?),
        "geometry_msgs/PoseStamped" => Message::PoseStamped(Field::read(w)?),
        "geometry_msgs/TwistStamped" => Message::TwistStamped(Field::read(w)?),
        "geometry_msgs/WrenchStamped" => Message::WrenchStamped(Field::read(w)?),
        _ => Message::Odometry(Box::new(Field::read(w)?)),
    };
    wire.finish()?;
    Ok(message)
}
