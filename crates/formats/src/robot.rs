//! What files cannot say of a robot: each robot plugs in here.

use crate::place::suggestion;
use crate::recording::RawMessage;
use crate::{Embedded, FormatsError};
use std::fmt;
use std::sync::Arc;
use tumble_dynamics::{ActuatorDrive, DynamicsError, InertialParameters};
use tumble_identification::recursive::{ErringThruster, THRUSTERS};
use tumble_identification::sensing::Sensing;
use tumble_lie::Wrench;

/// A body that files may name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyPreset {
    /// Its name in files.
    pub name: &'static str,
    /// Its mass properties about the body origin, body axes.
    pub body: InertialParameters<f64>,
}

/// Sensors that files and options may name.
#[derive(Clone, Debug, PartialEq)]
pub struct SensorPreset {
    /// Their name.
    pub name: &'static str,
    /// What they are, in a few words.
    pub sentence: &'static str,
    /// What a log shows of the true motion.
    pub sensing: Sensing,
}

/// Actuators that files may name.
#[derive(Clone, Copy, Debug)]
pub struct ActuatorPreset {
    /// Their name in files.
    pub name: &'static str,
    /// What they are, in a few words.
    pub sentence: &'static str,
    /// Makes them, at rest.
    pub make: fn() -> Result<Box<dyn ActuatorDrive>, DynamicsError>,
    /// What each makes per newton of thrust, body axes, torque about the body origin, and the share that it may err by: an estimator in flight learns
    /// these errors beside the body. [`ErringThruster::NONE`] where there is none.
    ///
    /// # Errors
    /// Actuators that cannot be.
    pub thrusters: fn() -> Result<[ErringThruster; THRUSTERS], DynamicsError>,
}

/// What a recorded command told the actuators: bytes that only their robot understands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ActuatorBytes {
    bytes: [u8; Self::MOST],
    count: u8,
}

impl ActuatorBytes {
    /// No command is longer, bytes.
    pub const MOST: usize = 64;

    /// A command; `None` where it is longer than [`MOST`](Self::MOST).
    pub fn new(command: &[u8]) -> Option<Self> {
        let mut bytes = [0; Self::MOST];
        bytes.get_mut(..command.len())?.copy_from_slice(command);
        Some(Self { bytes, count: u8::try_from(command.len()).ok()? })
    }

    /// The command.
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.count)).unwrap_or_default()
    }
}

/// From recorded commands to the wrench that the actuators made of them, body axes, torque about the body origin.
///
/// Commands come in the order of time. Between them, [`overdue_ns`](Self::overdue_ns) and [`go_on`](Self::go_on) let the actuators
/// do what they do by themselves; a machine that only holds its last command needs [`take`](Self::take) alone.
///
/// # Example
/// ```
/// use tumble_dynamics::lie::Wrench;
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_formats::recording::RawMessage;
/// use tumble_formats::{ActuatorBytes, ActuatorReplay, FormatsError};
///
/// /// A jet along x: one byte opens it, 255 is 2 N. Unless it is told again within a second, it shuts by itself.
/// #[derive(Default)]
/// struct Jet {
///     shuts_ns: Option<i64>,
/// }
/// impl ActuatorReplay for Jet {
///     fn command_type(&self) -> &'static str {
///         "kite_msgs/Jet"
///     }
///     fn decode(&self, message: &RawMessage<'_>) -> Result<Option<ActuatorBytes>, FormatsError> {
///         Ok(ActuatorBytes::new(message.payload).filter(|command| command.as_slice().len() == 1))
///     }
///     fn take(
///         &mut self,
///         time_ns: i64,
///         command: &ActuatorBytes,
///         _speeds: Option<[u8; 2]>,
///     ) -> Result<Option<Wrench<f64>>, FormatsError> {
///         let Some(byte) = command.as_slice().first() else { return Ok(None) };
///         self.shuts_ns = Some(time_ns + 1_000_000_000);
///         Ok(Some(Wrench::new(Vector3::zeros(), Vector3::x() * (2.0 * f64::from(*byte) / 255.0))))
///     }
///     fn overdue_ns(&self) -> Option<i64> {
///         self.shuts_ns
///     }
///     fn go_on(&mut self, _speeds: Option<[u8; 2]>) -> Result<Option<Wrench<f64>>, FormatsError> {
///         Ok(self.shuts_ns.take().map(|_| Wrench::zero()))
///     }
/// }
/// let mut jet: Box<dyn ActuatorReplay> = Box::new(Jet::default());
/// let command = ActuatorBytes::new(&[255]).ok_or("too long")?;
/// assert_eq!(jet.take(0, &command, None)?.map(|wrench| wrench.force.x), Some(2.0));
/// assert_eq!(jet.overdue_ns(), Some(1_000_000_000));
/// assert_eq!((jet.go_on(None)?, jet.overdue_ns()), (Some(Wrench::zero()), None));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
/// Tutorial: [a robot of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/tumble/examples/own_robot.rs).
pub trait ActuatorReplay: Send {
    /// Type of the messages that hold commands, `package/Name`.
    fn command_type(&self) -> &'static str;

    /// The command in a message of that type; `None` where it holds none. It counts from the time at which it was logged.
    ///
    /// # Errors
    /// [`FormatsError::foreign`] where no command of this recording can be understood: it ends the reading.
    fn decode(&self, message: &RawMessage<'_>) -> Result<Option<ActuatorBytes>, FormatsError>;

    /// A command that came at this time, with the measured speeds (counts) where there are any; the wrench that acts from then on,
    /// or `None` where the command takes effect later.
    ///
    /// # Errors
    /// [`FormatsError::foreign`] where nobody can say what the actuators make of it: it ends the reading.
    fn take(
        &mut self,
        time_ns: i64,
        command: &ActuatorBytes,
        speeds: Option<[u8; 2]>,
    ) -> Result<Option<Wrench<f64>>, FormatsError>;

    /// When the actuators go on by themselves if nothing comes before; `None` where they never do.
    fn overdue_ns(&self) -> Option<i64> {
        None
    }

    /// What acts from [`overdue_ns`](Self::overdue_ns) on.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    fn go_on(&mut self, _speeds: Option<[u8; 2]>) -> Result<Option<Wrench<f64>>, FormatsError> {
        Ok(None)
    }

    /// Nothing was heard for so long that nobody knows what the actuators did since.
    fn silence(&mut self) {}
}

/// A robot, as far as files speak of it.
///
/// # Example
/// ```
/// use tumble_dynamics::nalgebra::Vector3;
/// use tumble_dynamics::{InertialParameters, StatefulDrive, WrenchBox};
/// use tumble_formats::{ActuatorPreset, BodyPreset, Robot, Robots};
/// use tumble_identification::recursive::ErringThruster;
///
/// struct Kite;
///
/// impl Robot for Kite {
///     fn name(&self) -> &'static str {
///         "kite"
///     }
///     fn sentence(&self) -> &'static str {
///         "a satellite of 40 kg with ideal jets"
///     }
///     fn bodies(&self) -> Vec<BodyPreset> {
///         vec![BodyPreset { name: "kite", body: InertialParameters::solid_box(40.0, [0.6, 0.6, 0.8]) }]
///     }
///     fn actuators(&self) -> Vec<ActuatorPreset> {
///         vec![ActuatorPreset {
///             name: "jets",
///             sentence: "jets along and about every axis",
///             make: || {
///                 let limits = WrenchBox { torque_limit: Vector3::repeat(0.2), force_limit: Vector3::repeat(1.0) };
///                 Ok(Box::new(StatefulDrive::new(limits, ())))
///             },
///             thrusters: || Ok(ErringThruster::along_axes(0.01)),
///         }]
///     }
/// }
///
/// let robots = Robots::none().with(Kite);
/// assert_eq!(robots.body("kite").map(|body| body.mass), Ok(40.0));
/// assert!(robots.body("kit").unwrap_err().to_string().ends_with("known: kite; did you mean `kite`?"));
/// ```
/// Tutorial: [a robot of your own](https://github.com/tumble-robotics/tumble/blob/main/crates/tumble/examples/own_robot.rs).
pub trait Robot: Send + Sync {
    /// Its name.
    fn name(&self) -> &'static str;

    /// What it is, in one sentence.
    fn sentence(&self) -> &'static str;

    /// The bodies that files may name.
    fn bodies(&self) -> Vec<BodyPreset> {
        Vec::new()
    }

    /// The actuators that scenarios may name.
    fn actuators(&self) -> Vec<ActuatorPreset> {
        Vec::new()
    }

    /// Its sensors, by name; none where it brings none.
    fn sensors(&self) -> Vec<SensorPreset> {
        Vec::new()
    }

    /// Arms that come with it, as TOML or URDF.
    fn arms(&self) -> &[Embedded] {
        &[]
    }

    /// What turns recorded commands into wrenches; `None` where no recording holds any.
    fn replay(&self) -> Option<Box<dyn ActuatorReplay>> {
        None
    }
}

/// A name that no robot knows.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no {kind} is called `{asked}`; known: {}{nearest}", known.join(", "))]
pub struct UnknownPreset {
    /// What was looked for: "body", "actuator".
    pub kind: &'static str,
    /// The name asked for.
    pub asked: String,
    /// All names, in the order of the robots.
    pub known: Vec<&'static str>,
    /// "; did you mean ...?", or nothing.
    pub nearest: String,
}

impl UnknownPreset {
    /// The name asked for, those known and the nearest, to follow the name of a key.
    pub fn none_of(&self) -> String {
        format!("`{}` is none of {}{}", self.asked, self.known.join(", "), self.nearest)
    }

    fn new(kind: &'static str, asked: &str, known: Vec<&'static str>) -> Self {
        let nearest = suggestion(asked, known.iter().copied());
        Self { kind, asked: crate::log::shortened(asked), known, nearest }
    }
}

/// The robots that a program knows, in the order in which they are asked.
#[derive(Clone, Default)]
pub struct Robots(Vec<Arc<dyn Robot>>);

impl fmt::Debug for Robots {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.debug_list().entries(self.iter().map(Robot::name)).finish()
    }
}

impl PartialEq for Robots {
    /// Whether the same robots are asked in the same order, by their names.
    fn eq(&self, other: &Self) -> bool {
        self.iter().map(Robot::name).eq(other.iter().map(Robot::name))
    }
}

impl Robots {
    /// No robot: files that name none can be read.
    pub fn none() -> Self {
        Self::default()
    }

    /// One more robot.
    #[must_use]
    pub fn with(mut self, robot: impl Robot + 'static) -> Self {
        self.0.push(Arc::new(robot));
        self
    }

    /// Every robot.
    pub fn iter(&self) -> impl Iterator<Item = &dyn Robot> {
        self.0.iter().map(AsRef::as_ref)
    }

    /// The body of this name.
    ///
    /// # Errors
    /// [`UnknownPreset`], which lists the known.
    pub fn body(&self, name: &str) -> Result<InertialParameters<f64>, UnknownPreset> {
        let bodies: Vec<BodyPreset> = self.iter().flat_map(Robot::bodies).collect();
        let found = bodies.iter().find(|preset| preset.name == name).map(|preset| preset.body);
        found.ok_or_else(|| UnknownPreset::new("body", name, bodies.iter().map(|preset| preset.name).collect()))
    }

    /// Every robot's sensors.
    pub fn sensors(&self) -> Vec<SensorPreset> {
        self.iter().flat_map(Robot::sensors).collect()
    }

    /// The sensors of this name.
    ///
    /// # Errors
    /// [`UnknownPreset`], which lists the known.
    pub fn sensing(&self, name: &str) -> Result<Sensing, UnknownPreset> {
        let presets = self.sensors();
        let found = presets.iter().find(|preset| preset.name == name).map(|preset| preset.sensing.clone());
        found.ok_or_else(|| UnknownPreset::new("sensor", name, presets.iter().map(|preset| preset.name).collect()))
    }

    /// The actuators of this name.
    ///
    /// # Errors
    /// [`UnknownPreset`], which lists the known.
    pub fn actuators(&self, name: &str) -> Result<ActuatorPreset, UnknownPreset> {
        let presets: Vec<ActuatorPreset> = self.iter().flat_map(Robot::actuators).collect();
        let found = presets.iter().find(|preset| preset.name == name).copied();
        found.ok_or_else(|| UnknownPreset::new("actuator", name, presets.iter().map(|preset| preset.name).collect()))
    }

    /// The arms that need no file, those of no robot last.
    pub fn arms(&self) -> Vec<Embedded> {
        self.iter().flat_map(|robot| robot.arms().to_vec()).chain(crate::arm::EMBEDDED).collect()
    }

    /// What turns recorded commands into wrenches, of every robot that recordings hold commands of.
    pub fn replays(&self) -> impl Iterator<Item = Box<dyn ActuatorReplay>> {
        self.iter().filter_map(Robot::replay)
    }
}
