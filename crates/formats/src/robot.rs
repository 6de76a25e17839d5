//! What files cannot say of a robot: each robot plugs in here.

use crate::Embedded;
use std::sync::Arc;
use tumble_dynamics::InertialParameters;
use tumble_lie::Wrench;

/// A body that files may name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyPreset {
    /// Its name in files.
    pub name: &'static str,
    /// Its mass properties about the body origin, body axes.
    pub body: InertialParameters<f64>,
}

/// The bytes that a robot with two propulsion modules of six nozzles each was told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ModuleCommand {
    /// Speeds of the two impellers, counts.
    pub impeller_speeds: [u8; 2],
    /// Flap positions of the nozzles, module by module, counts.
    pub nozzles: [u8; 12],
}

/// From recorded commands to the wrench that the actuators made of them, body axes, torque about the body origin.
///
/// Commands come in the order of time. Between them, [`overdue_ns`](Self::overdue_ns) and [`go_on`](Self::go_on) let the actuators
/// do what they do by themselves.
pub trait ActuatorReplay: Send {
    /// A command that came at this time, with the measured impeller speeds where there are any; the wrench that acts from then on,
    /// or `None` where the command takes effect later.
    fn take(&mut self, time_ns: i64, command: &ModuleCommand, speeds: Option<[u8; 2]>) -> Option<Wrench<f64>>;

    /// When the actuators go on by themselves if nothing comes before; `None` where they never do.
    fn overdue_ns(&self) -> Option<i64>;

    /// What acts from [`overdue_ns`](Self::overdue_ns) on.
    fn go_on(&mut self, speeds: Option<[u8; 2]>) -> Option<Wrench<f64>>;

    /// Nothing was heard for so long that nobody knows what the actuators did since.
    fn silence(&mut self);
}

/// A robot, as far as files speak of it.
pub trait Robot: Send + Sync {
    /// Its name.
    fn name(&self) -> &'static str;

    /// What it is, in one sentence.
    fn sentence(&self) -> &'static str;

    /// The bodies that files may name.
    fn bodies(&self) -> Vec<BodyPreset> {
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

/// The robots that a program knows, in the order in which they are asked.
#[derive(Clone, Default)]
pub struct Robots(Vec<Arc<dyn Robot>>);

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

    /// The bodies that files may name.
    pub fn bodies(&self) -> Vec<BodyPreset> {
        self.iter().flat_map(Robot::bodies).collect()
    }

    /// The body of this name.
    pub fn body(&self, name: &str) -> Option<InertialParameters<f64>> {
        self.bodies().into_iter().find(|preset| preset.name == name).map(|preset| preset.body)
    }

    /// The arms that need no file, those of no robot last.
    pub fn arms(&self) -> Vec<Embedded> {
        self.iter().flat_map(|robot| robot.arms().to_vec()).chain(crate::arm::EMBEDDED).collect()
    }

    /// What turns recorded commands into wrenches.
    pub fn replay(&self) -> Option<Box<dyn ActuatorReplay>> {
        self.iter().find_map(Robot::replay)
    }
}
