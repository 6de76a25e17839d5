//! The CSV log: pose, optional rates and accelerations, wrench, against time.
//!
//! Rows are streamed; a log of any size is read in bounded memory.

mod cell;
mod joints;
mod row;
mod timed_rows;

pub use cell::{QUATERNION_NORM_TOLERANCE, parse_time_ns, seconds, shortened};
pub use joints::{JointLayout, JointLog, JointLogReader, JointRow, joint_template};
pub use row::{BoundedRows, Header, ROW_LIMIT_BYTES, Row, cut_warning, line_read, read_row};
pub use timed_rows::{RowLayout, TimedRows};

use crate::FormatsError;
use crate::text_file::open_regular;
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use timed_rows::open_file;
use tumble_identification::MotionSample;
use tumble_lie::Pose;
use tumble_lie::nalgebra::{UnitQuaternion, Vector3};

/// The columns that no log of poses can do without.
pub const REQUIRED: [&str; 8] = ["t_s", "p_x", "p_y", "p_z", "q_x", "q_y", "q_z", "q_w"];
/// The columns that take the place of `p_x` to `q_w` in a log of motion in a plane.
pub const PLANAR: [&str; 3] = ["p_x", "p_y", "yaw_rad"];
const VELOCITY: [&str; 3] = ["v_x", "v_y", "v_z"];
const RATE: [&str; 3] = ["w_x", "w_y", "w_z"];
const ACCELERATION: [&str; 3] = ["a_x", "a_y", "a_z"];
const FORCE: [&str; 3] = ["f_x", "f_y", "f_z"];
const TORQUE: [&str; 3] = ["tau_x", "tau_y", "tau_z"];
/// Momentum of wheels relative to the body.
pub(crate) const STORED: [&str; 3] = ["stored_x", "stored_y", "stored_z"];
/// What acts beside the wrench, force first as in a log.
pub(crate) const ENVIRONMENT: [&str; 6] = ["env_f_x", "env_f_y", "env_f_z", "env_tau_x", "env_tau_y", "env_tau_z"];

/// Columns that a simulated flight adds for comparison; no estimate reads them.
const SIMULATED: [&str; 6] = ["true_", "cmd_", "est_", "sigma_", "plan_revision", "belief_revision"];

/// What `tumble identify --template` prints: a header with every column and two valid rows.
pub const TEMPLATE: &str = "\
t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,v_x,v_y,v_z,w_x,w_y,w_z,a_x,a_y,a_z,f_x,f_y,f_z,tau_x,tau_y,tau_z
0.000,0,0,0,0,0,0,1,0,0,0,0,0,0,0.0104,0,0,0.1,0,0,0,0.002,0
0.016,1.33e-6,0,0,0,0,0,1,0.000167,0,0,0,0.000208,0,0.0104,0,0,0.1,0,0,0,0.002,0
";

/// Where the optional columns of the body's motion stand; nothing stands where a planar log has no column.
struct MotionColumns {
    velocity: Option<[Option<usize>; 3]>,
    rate: Option<[Option<usize>; 3]>,
    acceleration: Option<[Option<usize>; 3]>,
    wrench: Option<[Option<usize>; 6]>,
    stored: Option<[Option<usize>; 3]>,
    environment: Option<[Option<usize>; 6]>,
}

impl MotionColumns {
    const KNOWN: [[&str; 3]; 6] = [VELOCITY, RATE, ACCELERATION, FORCE, TORQUE, STORED];

    fn find(header: &Header) -> Result<Self, FormatsError> {
        let all = |columns| header.group::<3>(columns).map(|found| found.map(|found| found.map(Some)));
        let wrench = header.group([TORQUE[0], TORQUE[1], TORQUE[2], FORCE[0], FORCE[1], FORCE[2]])?;
        let [fx, fy, fz, tx, ty, tz] = ENVIRONMENT;
        Ok(Self {
            velocity: all(VELOCITY)?,
            rate: all(RATE)?,
            acceleration: all(ACCELERATION)?,
            wrench: wrench.map(|found| found.map(Some)),
            stored: all(STORED)?,
            environment: header.group([tx, ty, tz, fx, fy, fz])?.map(|found| found.map(Some)),
        })
    }

    /// Two axes of what moves, one of what turns.
    fn in_plane(header: &Header) -> Result<Self, FormatsError> {
        let two = |[x, y, _]: [&str; 3]| header.group([x, y]).map(|found| found.map(|[x, y]| [Some(x), Some(y), None]));
        let wrench = |names: [&str; 3]| {
            let found = header.group(names)?;
            Ok::<_, FormatsError>(found.map(|[about, x, y]| [None, None, Some(about), Some(x), Some(y), None]))
        };
        let about = |[.., z]: [&str; 3]| header.position(z).map(|about| [None, None, Some(about)]);
        Ok(Self {
            velocity: two(VELOCITY)?,
            rate: about(RATE),
            acceleration: two(ACCELERATION)?,
            wrench: wrench([TORQUE[2], FORCE[0], FORCE[1]])?,
            stored: about(STORED),
            environment: wrench([ENVIRONMENT[5], ENVIRONMENT[0], ENVIRONMENT[1]])?,
        })
    }

    /// Whether it is one of them, or one that only simulated flights have.
    fn knows(column: &str) -> bool {
        let is_read = Self::KNOWN.as_flattened().contains(&column) || ENVIRONMENT.contains(&column);
        is_read || SIMULATED.iter().any(|prefix| column.starts_with(prefix))
    }
}

/// Where the columns of a pose stand.
enum PoseColumns {
    /// Position, quaternion.
    Full([usize; 7]),
    /// Two coordinates in the plane and the angle about its normal.
    Planar([usize; 3]),
}

/// Where the columns of a log of poses stand.
pub struct MotionLayout {
    time: usize,
    pose: PoseColumns,
    motion: MotionColumns,
}

impl MotionLayout {
    fn find(header: &Header) -> Result<Self, FormatsError> {
        let [time, pose @ ..] = REQUIRED;
        let time = header.required(time, "")?;
        if header.position(PLANAR[2]).is_some() && pose[2..].iter().all(|name| header.position(name).is_none()) {
            let columns = header.group(PLANAR)?.ok_or_else(|| header.lacks(PLANAR[2]))?;
            let motion = MotionColumns::in_plane(header)?;
            return Ok(MotionLayout { time, pose: PoseColumns::Planar(columns), motion });
        }
        let mut columns = [0; 7];
        for (slot, column) in columns.iter_mut().zip(pose) {
            *slot = header.required(column, "")?;
        }
        Ok(MotionLayout { time, pose: PoseColumns::Full(columns), motion: MotionColumns::find(header)? })
    }

    fn is_planar(&self) -> bool {
        matches!(self.pose, PoseColumns::Planar(_))
    }
}

impl RowLayout for MotionLayout {
    type Sample = MotionSample;

    fn time_column(&self) -> usize {
        self.time
    }

    fn knows(&self, column: &str) -> bool {
        let is_pose = match self.pose {
            PoseColumns::Full(_) => REQUIRED.contains(&column),
            PoseColumns::Planar(_) => PLANAR.contains(&column) || column == REQUIRED[0],
        };
        is_pose || MotionColumns::knows(column)
    }

    fn sample(&self, row: &Row, time_ns: i64) -> Result<MotionSample, FormatsError> {
        let world_from_body = match self.pose {
            PoseColumns::Full(columns) => {
                row.optional(Some(columns.map(Some)))?.map(|pose| row.pose(pose)).transpose()?
            }
            PoseColumns::Planar(columns) => row.optional(Some(columns.map(Some)))?.map(|[x, y, yaw_rad]| {
                let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
                Pose::from_parts(Vector3::new(x, y, 0.0).into(), turn)
            }),
        };
        Ok(MotionSample {
            time_ns,
            world_from_body,
            velocity_origin_world: row.vector(self.motion.velocity)?,
            rate_body: row.vector(self.motion.rate)?,
            acceleration_origin_body: row.vector(self.motion.acceleration)?,
            wrench_body: row.wrench(self.motion.wrench)?,
            besides_body: row.wrench(self.motion.environment)?,
            stored_momentum_body: row.vector(self.motion.stored)?,
        })
    }
}

/// What a command of an actuator may be.
const COMMANDS: &str = "a command lies between 0 and 1";

/// Where the columns of a log of poses and commands of actuators stand.
pub struct CommandedLayout {
    motion: MotionLayout,
    names: Vec<String>,
    columns: Vec<usize>,
}

/// A sample and what each actuator was told from it on; nothing where its cell is empty.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandedSample {
    /// The motion; its wrench is that of the log, where there is one.
    pub motion: MotionSample,
    /// Commands between zero and one.
    pub commands: Vec<Option<f64>>,
}

impl RowLayout for CommandedLayout {
    type Sample = CommandedSample;

    fn time_column(&self) -> usize {
        self.motion.time
    }

    fn knows(&self, column: &str) -> bool {
        self.motion.knows(column) || self.names.iter().any(|name| name == column)
    }

    fn sample(&self, row: &Row, time_ns: i64) -> Result<CommandedSample, FormatsError> {
        let command = |column: &usize| {
            let Some([command]) = row.optional(Some([Some(*column)]))? else { return Ok(None) };
            if (0.0..=1.0).contains(&command) { Ok(Some(command)) } else { Err(row.out_of_range(*column, COMMANDS)) }
        };
        let commands = self.columns.iter().map(command).collect::<Result<_, _>>()?;
        Ok(CommandedSample { motion: self.motion.sample(row, time_ns)?, commands })
    }
}

/// Streams the samples and commands of one log.
pub type CommandedReader<R = File> = TimedRows<R, CommandedLayout>;

impl TimedRows<File, CommandedLayout> {
    /// Opens a log whose actuators are commanded in these columns, and reads its header.
    ///
    /// # Errors
    /// As [`LogReader::open`].
    pub fn open(path: &Path, reorder: bool, columns: &[String]) -> Result<Self, FormatsError> {
        Self::start(open_file(path)?, path, reorder, |header| {
            let places = columns.iter().map(|name| header.required(name, NAMED_BY_THE_ACTUATORS));
            let places = places.collect::<Result<_, _>>()?;
            Ok(CommandedLayout { motion: MotionLayout::find(header)?, names: columns.to_vec(), columns: places })
        })
    }

    /// As that of [`LogReader`].
    pub fn is_planar(&self) -> bool {
        self.layout().motion.is_planar()
    }
}

/// Why a column of commands must be there.
pub(crate) const NAMED_BY_THE_ACTUATORS: &str = "; the actuator file names it";

/// Streams the samples of one log of poses.
pub type LogReader<R = File> = TimedRows<R, MotionLayout>;

impl TimedRows<File, MotionLayout> {
    /// Opens a log and reads its header.
    ///
    /// # Errors
    /// [`FormatsError`] for an unreadable or empty file and for missing or duplicate columns.
    pub fn open(path: &Path, reorder: bool) -> Result<Self, FormatsError> {
        Self::from_reader(open_file(path)?, path, reorder)
    }
}

impl<R: Read> TimedRows<R, MotionLayout> {
    /// Reads the header of the log that `source` yields; `path` is its name in errors.
    ///
    /// # Errors
    /// As [`LogReader::open`].
    pub fn from_reader(source: R, path: &Path, reorder: bool) -> Result<Self, FormatsError> {
        Self::start(source, path, reorder, MotionLayout::find)
    }

    /// Whether the log is of motion in a plane: what its columns lack was not measured, and stands at zero in its samples.
    pub fn is_planar(&self) -> bool {
        self.layout().is_planar()
    }
}

/// A 64-bit FNV-1a hash of a file's bytes, hexadecimal: tells whether two runs read the same log.
///
/// # Errors
/// [`FormatsError::Unreadable`], also for a pipe or a device, which could be without end.
pub fn hash(path: &Path) -> Result<String, FormatsError> {
    let unreadable = |source| FormatsError::Unreadable { path: path.into(), source };
    let mut file = BufReader::new(open_regular(path).map_err(unreadable)?);
    let mut buffer = [0; 8192];
    let mut hash: u64 = 0xcbf2_9ce4_8422_2325;
    loop {
        let count = file.read(&mut buffer).map_err(unreadable)?;
        if count == 0 {
            return Ok(format!("fnv1a64:{hash:016x}"));
        }
        for byte in buffer.iter().take(count) {
            hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_lie::nalgebra::{Vector3, Vector4};

    #[test]
    fn every_cell_lands_where_its_column_says() {
        let text = "f_z,q_w,q_x,q_y,q_z,t_s,p_z,p_x,p_y,tau_x,tau_y,tau_z,f_x,f_y,w_x,w_y,w_z\n\
                    6,0.5,0.1,-0.7,0.5,1700000000.000000001,13,11,12,1,2,3,4,5,7,8,9\n";
        let path = crate::testing::scratch_file("log-columns.csv", text);
        let sample = LogReader::open(&path, false).unwrap().next_sample().unwrap().unwrap();
        std::fs::remove_file(&path).unwrap();
        assert_eq!(sample.time_ns, 1_700_000_000_000_000_001);
        let pose = sample.world_from_body.unwrap();
        assert_eq!(pose.translation.vector, Vector3::new(11.0, 12.0, 13.0));
        let (q, expected) = (pose.rotation.coords, Vector4::new(0.1, -0.7, 0.5, 0.5));
        assert!((q - expected).amax() < 1e-15, "{q:?}");
        let wrench = sample.wrench_body.unwrap();
        assert_eq!((wrench.torque, wrench.force), (Vector3::new(1.0, 2.0, 3.0), Vector3::new(4.0, 5.0, 6.0)));
        assert_eq!(sample.rate_body, Some(Vector3::new(7.0, 8.0, 9.0)));
        assert_eq!((sample.velocity_origin_world, sample.acceleration_origin_body), (None, None));
    }
}
