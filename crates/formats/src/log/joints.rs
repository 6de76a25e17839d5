//! The CSV log of an arm: joint positions, optional rates, accelerations, torques and currents, optional motion of the
//! base, against time.

use super::row::{Header, PART_OF_A_GROUP, Row};
use super::timed_rows::open_file;
use super::{MotionColumns, REQUIRED, RowLayout, TimedRows};
use crate::FormatsError;
use crate::arm::{ArmModel, BaseKind};
use std::fs::File;
use std::io::Read;
use std::path::Path;
use tumble_dynamics::JointAxis;
use tumble_dynamics::nalgebra::Vector3;
use tumble_lie::{Pose, Twist, Wrench};

/// What is measured of a joint, as its column begins.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Quantity {
    Position,
    Rate,
    Acceleration,
    Torque,
    Current,
}

impl Quantity {
    const ALL: [Self; 5] = [Self::Position, Self::Rate, Self::Acceleration, Self::Torque, Self::Current];

    fn prefix(self) -> &'static str {
        match self {
            Self::Position => "q",
            Self::Rate => "qd",
            Self::Acceleration => "qdd",
            Self::Torque => "tau",
            Self::Current => "i",
        }
    }

    fn unit(self, joint: JointAxis) -> &'static str {
        match (self, joint) {
            (Self::Position, JointAxis::Revolute) => "_rad",
            (Self::Position, JointAxis::Prismatic) => "_m",
            (Self::Rate, JointAxis::Revolute) => "_rad_s",
            (Self::Rate, JointAxis::Prismatic) => "_m_s",
            (Self::Acceleration, JointAxis::Revolute) => "_rad_s2",
            (Self::Acceleration, JointAxis::Prismatic) => "_m_s2",
            (Self::Torque, JointAxis::Revolute) => "_N_m",
            (Self::Torque, JointAxis::Prismatic) => "_N",
            (Self::Current, _) => "_A",
        }
    }

    /// The column of a joint, counted from one.
    fn column(self, number: usize, joint: JointAxis) -> String {
        format!("{}{number}{}", self.prefix(), self.unit(joint))
    }

    /// The joint that a column of this quantity is of, whatever its number and kind.
    fn joint_of(self, column: &str) -> Option<usize> {
        let rest = column.strip_prefix(self.prefix())?;
        let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
        let (number, unit) = rest.split_at_checked(end)?;
        let fits =
            unit.is_empty() || [JointAxis::Revolute, JointAxis::Prismatic].iter().any(|kind| self.unit(*kind) == unit);
        // more digits than a number of joints has are none of its columns
        number.parse().ok().filter(|_| fits)
    }
}

/// What was measured of an arm at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct JointRow {
    /// Time, ns.
    pub time_ns: i64,
    /// Pose of the base.
    pub world_from_base: Option<Pose<f64>>,
    /// Velocity of the base origin, world axes, m/s.
    pub base_velocity_world: Option<Vector3<f64>>,
    /// Rate of the base, base axes, rad/s.
    pub base_rate: Option<Vector3<f64>>,
    /// Inertial acceleration of the base origin, base axes, m/s^2.
    pub base_acceleration: Option<Vector3<f64>>,
    /// Every wrench on the base but gravity and what the joints give, base axes, about its origin.
    pub base_wrench: Option<Wrench<f64>>,
    /// Joint positions in the order of the tree, rad or m.
    pub positions: Vec<f64>,
    /// Joint rates, rad/s or m/s.
    pub rates: Option<Vec<f64>>,
    /// Joint accelerations, rad/s^2 or m/s^2.
    pub accelerations: Option<Vec<f64>>,
    /// Joint torques or forces, N m or N.
    pub torques: Option<Vec<f64>>,
    /// Motor currents, A.
    pub currents: Option<Vec<f64>>,
}

impl JointRow {
    /// Twist of the base origin, base axes; `None` unless attitude, velocity and rate were measured.
    pub fn base_twist(&self) -> Option<Twist<f64>> {
        let velocity = self.world_from_base?.rotation.inverse() * self.base_velocity_world?;
        Some(Twist::new(self.base_rate?, velocity))
    }
}

/// Where the columns of a joint log stand.
pub struct JointLayout {
    time: usize,
    pose: Option<[usize; 7]>,
    motion: MotionColumns,
    positions: Vec<usize>,
    rates: Option<Vec<usize>>,
    accelerations: Option<Vec<usize>>,
    torques: Option<Vec<usize>>,
    currents: Option<Vec<usize>>,
}

impl JointLayout {
    fn find(header: &Header, path: &Path, arm: &ArmModel) -> Result<Self, FormatsError> {
        let joints = arm.tree.joints();
        for name in &header.names {
            let number = Quantity::ALL.iter().find_map(|quantity| quantity.joint_of(name));
            if number.is_some_and(|number| number == 0 || number > joints) {
                let column = super::shortened(name);
                return Err(FormatsError::JointColumn { path: path.into(), column, arm: arm.name.clone(), joints });
            }
        }
        let [time, pose @ ..] = REQUIRED;
        let optional = |quantity| {
            let columns = joint_columns(header, arm, quantity)?;
            if columns.iter().all(Option::is_none) {
                Ok(None)
            } else {
                all(columns, path, arm, quantity, PART_OF_A_GROUP).map(Some)
            }
        };
        let positions = joint_columns(header, arm, Quantity::Position)?;
        Ok(Self {
            time: header.required(time, "")?,
            pose: header.group(pose)?,
            motion: MotionColumns::find(header)?,
            positions: all(positions, path, arm, Quantity::Position, "")?,
            rates: optional(Quantity::Rate)?,
            accelerations: optional(Quantity::Acceleration)?,
            torques: optional(Quantity::Torque)?,
            currents: optional(Quantity::Current)?,
        })
    }
}

/// Where a quantity of each joint stands, with its unit in the name or without.
fn joint_columns(header: &Header, arm: &ArmModel, quantity: Quantity) -> Result<Vec<Option<usize>>, FormatsError> {
    let of_joint = |(number, link): (usize, &tumble_dynamics::Link<f64>)| {
        let name = quantity.column(number, link.joint.kind());
        let bare = format!("{}{number}", quantity.prefix());
        match (header.position(&name), header.position(&bare)) {
            (Some(_), Some(_)) => Err(header.twice(&bare)),
            (with_unit, without) => Ok(with_unit.or(without)),
        }
    };
    (1..).zip(arm.tree.links()).map(of_joint).collect()
}

/// The columns of all joints, or the first that is missing.
fn all(
    columns: Vec<Option<usize>>,
    path: &Path,
    arm: &ArmModel,
    quantity: Quantity,
    because: &'static str,
) -> Result<Vec<usize>, FormatsError> {
    let named = columns.into_iter().zip((1..).zip(arm.tree.links()));
    named
        .map(|(column, (number, link))| {
            column.ok_or_else(|| FormatsError::MissingColumn {
                path: path.into(),
                column: quantity.column(number, link.joint.kind()),
                because,
            })
        })
        .collect()
}

impl RowLayout for JointLayout {
    type Sample = JointRow;

    fn time_column(&self) -> usize {
        self.time
    }

    fn knows(&self, column: &str) -> bool {
        let of_a_joint = || Quantity::ALL.iter().any(|quantity| quantity.joint_of(column).is_some());
        REQUIRED.contains(&column) || MotionColumns::knows(column) || of_a_joint()
    }

    fn sample(&self, row: &Row, time_ns: i64) -> Result<JointRow, FormatsError> {
        let pose = row.optional(self.pose.map(|columns| columns.map(Some)))?;
        Ok(JointRow {
            time_ns,
            world_from_base: pose.map(|pose| row.pose(pose)).transpose()?,
            base_velocity_world: row.vector(self.motion.velocity)?,
            base_rate: row.vector(self.motion.rate)?,
            base_acceleration: row.vector(self.motion.acceleration)?,
            base_wrench: row.wrench(self.motion.wrench)?,
            positions: self.positions.iter().map(|column| row.number(*column)).collect::<Result<_, _>>()?,
            rates: row.optional_list(self.rates.as_deref())?,
            accelerations: row.optional_list(self.accelerations.as_deref())?,
            torques: row.optional_list(self.torques.as_deref())?,
            currents: row.optional_list(self.currents.as_deref())?,
        })
    }
}

/// Streams the rows of one log of an arm.
pub type JointLogReader<R = File> = TimedRows<R, JointLayout>;

impl TimedRows<File, JointLayout> {
    /// Opens a log of this arm and reads its header.
    ///
    /// # Errors
    /// [`FormatsError`] for an unreadable or empty file, for missing or duplicate columns and for joints that the arm
    /// does not have.
    pub fn open(path: &Path, arm: &ArmModel, reorder: bool) -> Result<Self, FormatsError> {
        Self::from_reader(open_file(path)?, path, arm, reorder)
    }
}

impl<R: Read> TimedRows<R, JointLayout> {
    /// Reads the header of the log that `source` yields; `path` is its name in errors.
    ///
    /// # Errors
    /// As [`JointLogReader::open`].
    pub fn from_reader(source: R, path: &Path, arm: &ArmModel, reorder: bool) -> Result<Self, FormatsError> {
        Self::start(source, path, reorder, |header| JointLayout::find(header, path, arm))
    }
}

/// A log of an arm as a whole.
#[derive(Clone, Debug, PartialEq)]
pub struct JointLog {
    /// Its rows, later ones last; at least one.
    pub rows: Vec<JointRow>,
    /// What a user should know about it.
    pub warnings: Vec<String>,
}

impl JointLog {
    /// Reads a log of this arm.
    ///
    /// # Errors
    /// [`FormatsError`] naming the file, and of a row its line and column.
    pub fn read(path: &Path, arm: &ArmModel, reorder: bool) -> Result<Self, FormatsError> {
        Self::from_reader(open_file(path)?, path, arm, reorder)
    }

    /// Reads the log that `source` yields; `path` is its name in errors.
    ///
    /// # Errors
    /// As [`JointLog::read`].
    pub fn from_reader(source: impl Read, path: &Path, arm: &ArmModel, reorder: bool) -> Result<Self, FormatsError> {
        let mut reader = JointLogReader::from_reader(source, path, arm, reorder)?;
        let mut rows = Vec::new();
        while let Some(row) = reader.next_sample()? {
            rows.push(row);
        }
        if rows.is_empty() {
            return Err(FormatsError::Empty { path: path.into(), what: "data rows" });
        }
        Ok(Self { rows, warnings: reader.warnings() })
    }
}

/// A log of this arm with every column and two valid rows, in which nothing moves.
pub fn joint_template(arm: &ArmModel) -> String {
    let mut columns = vec!["t_s".to_owned()];
    if arm.base_kind == BaseKind::Free {
        let base = REQUIRED.iter().skip(1).chain(MotionColumns::KNOWN.as_flattened());
        columns.extend(base.map(|name| (*name).to_owned()));
    }
    for quantity in Quantity::ALL {
        columns.extend((1..).zip(arm.tree.links()).map(|(number, link)| quantity.column(number, link.joint.kind())));
    }
    let row = |time: &str| {
        let cells = columns.iter().map(|name| match name.as_str() {
            "t_s" => time,
            "q_w" => "1",
            _ => "0",
        });
        cells.collect::<Vec<_>>().join(",")
    };
    format!("{}\n{}\n{}\n", columns.join(","), row("0.000"), row("0.010"))
}
