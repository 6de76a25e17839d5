//! An environment as a table, in a file or in a scenario: what acts on a body beside its actuators.

use crate::text_file;
use crate::toml_text::{self, TomlError};
use crate::{FormatsError, place};
use serde::{Deserialize, Serialize};
use std::path::Path;
use tumble_dynamics::nalgebra::{SVector, UnitQuaternion, Vector3};
use tumble_dynamics::{
    ConstantBodyWrench, ConstantWorldWrench, Environment, GravityGradient, InertialParameters, LinearDrag,
    QuadraticDrag,
};
use tumble_lie::{LieGroup, Wrench};

/// Largest size of any number, and largest rate of an orbit, rad/s: that of the lowest round the earth is 1.2e-3.
const MOST: f64 = 1e6;
const MOST_RATE_RAD_S: f64 = 1.0;
/// Latest time on any clock, s.
const LATEST_S: f64 = 1e10;
/// Cosine of the angle between nadir and normal of an orbit up to which they are taken to be square to each other.
const SQUARE: f64 = 1e-3;

/// What acts on a body beside its actuators; a table that is left out does not act.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EnvironmentTable {
    /// The gradient of gravity on a circular orbit.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gravity_gradient: Option<GravityGradientTable>,
    /// Drag in proportion to speed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub linear_drag: Option<LinearDragTable>,
    /// Drag in proportion to the square of speed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quadratic_drag: Option<QuadraticDragTable>,
    /// A wrench that turns with the body: a leak.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant_body: Option<ConstantTable>,
    /// A wrench that does not: a pressure.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub constant_world: Option<ConstantTable>,
}

/// The gradient of gravity on a circular orbit, as seen from a point on it that falls freely, `n^2 (3 u u^T - 1)`; world axes do not turn.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GravityGradientTable {
    /// Rate `n` of the orbit, rad/s: the square root of mu over the cube of the radius.
    pub rate_rad_s: f64,
    /// Where the centre of attraction is, world axes, of any length; down along z unless given.
    #[serde(default = "down")]
    pub nadir: [f64; 3],
    /// Axis about which it goes round by the right hand, world axes, of any length, square to it; it stays where it is unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub orbit_normal: Option<[f64; 3]>,
    /// When it is there, s, on the clock of the log.
    #[serde(default)]
    pub at_s: f64,
    /// The point that falls freely, world axes, m.
    #[serde(default)]
    pub center_m: [f64; 3],
}

fn down() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

/// Drag in proportion to speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LinearDragTable {
    /// Force per speed of the centre of pressure through the air, N s/m.
    pub force_n_s_m: f64,
    /// Torque per rate, N m s/rad.
    pub torque_n_m_s_rad: f64,
    /// Where the force acts, body axes, m.
    pub center_of_pressure_m: [f64; 3],
    /// Velocity of the air, world axes, m/s.
    pub wind_m_s: [f64; 3],
}

/// Drag in proportion to the square of speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct QuadraticDragTable {
    /// Force per squared speed of the centre of pressure through the air, `1/2 rho C_d A`, N s^2/m^2.
    pub force_n_s2_m2: f64,
    /// Torque per squared rate, N m s^2/rad^2.
    pub torque_n_m_s2_rad2: f64,
    /// Where the force acts, body axes, m.
    pub center_of_pressure_m: [f64; 3],
    /// Velocity of the air, world axes, m/s.
    pub wind_m_s: [f64; 3],
}

/// A wrench that does not change, torque about the body origin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConstantTable {
    /// Force, N.
    pub force_n: [f64; 3],
    /// Torque, N m.
    pub torque_n_m: [f64; 3],
}

/// A number of a table that cannot be.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{key}`: {message}")]
pub struct ImpossibleNumber {
    /// The dotted key.
    pub key: String,
    /// What stands there, and what may.
    pub message: String,
}

impl EnvironmentTable {
    /// The models that it describes. The gradient of gravity is on the body that it is asked for; on none of its own.
    ///
    /// # Errors
    /// [`ImpossibleNumber`].
    ///
    /// # Example
    /// ```
    /// use tumble_formats::environment_file::{ConstantTable, EnvironmentTable};
    /// let leak = ConstantTable { force_n: [1e-3, 0.0, 0.0], ..ConstantTable::default() };
    /// let table = EnvironmentTable { constant_body: Some(leak), ..EnvironmentTable::default() };
    /// assert!(!table.environment()?.is_empty());
    /// # Ok::<(), tumble_formats::environment_file::ImpossibleNumber>(())
    /// ```
    pub fn environment(&self) -> Result<Environment, ImpossibleNumber> {
        let mut acting = Environment::default();
        if let Some(table) = &self.gravity_gradient {
            acting = acting.with(table.model()?);
        }
        if let Some(table) = &self.linear_drag {
            acting = acting.with(LinearDrag {
                center_of_pressure: vector("linear_drag.center_of_pressure_m", table.center_of_pressure_m)?,
                force_coefficient: coefficient("linear_drag.force_n_s_m", table.force_n_s_m)?,
                torque_coefficient: coefficient("linear_drag.torque_n_m_s_rad", table.torque_n_m_s_rad)?,
                medium_velocity_world: vector("linear_drag.wind_m_s", table.wind_m_s)?,
            });
        }
        if let Some(table) = &self.quadratic_drag {
            acting = acting.with(QuadraticDrag {
                center_of_pressure: vector("quadratic_drag.center_of_pressure_m", table.center_of_pressure_m)?,
                force_coefficient: coefficient("quadratic_drag.force_n_s2_m2", table.force_n_s2_m2)?,
                torque_coefficient: coefficient("quadratic_drag.torque_n_m_s2_rad2", table.torque_n_m_s2_rad2)?,
                medium_velocity_world: vector("quadratic_drag.wind_m_s", table.wind_m_s)?,
            });
        }
        if let Some(table) = &self.constant_body {
            acting = acting.with(ConstantBodyWrench { wrench_body: table.wrench("constant_body")? });
        }
        if let Some(table) = &self.constant_world {
            acting = acting.with(ConstantWorldWrench { wrench_world: table.wrench("constant_world")? });
        }
        Ok(acting)
    }
}

impl GravityGradientTable {
    fn model(&self) -> Result<GravityGradient<f64>, ImpossibleNumber> {
        let rate_rad_s = self.rate_rad_s;
        if !(rate_rad_s > 0.0 && rate_rad_s <= MOST_RATE_RAD_S) {
            let message = format!("{rate_rad_s}: above 0 and at most {MOST_RATE_RAD_S} rad/s");
            return Err(impossible("gravity_gradient.rate_rad_s", message));
        }
        let nadir = direction("gravity_gradient.nadir", self.nadir)?;
        let turn_rate = match self.orbit_normal {
            None => Vector3::zeros(),
            Some(axis) => {
                let normal = direction("gravity_gradient.orbit_normal", axis)?;
                let cosine = normal.dot(&nadir);
                if cosine.abs() > SQUARE {
                    let message = format!("square to `nadir`, not at a cosine of {cosine:.3} to it");
                    return Err(impossible("gravity_gradient.orbit_normal", message));
                }
                normal * rate_rad_s
            }
        };
        if self.at_s.is_nan() || self.at_s.abs() > LATEST_S {
            let message = format!("{}: seconds, at most {LATEST_S:.0e} either way", self.at_s);
            return Err(impossible("gravity_gradient.at_s", message));
        }
        let back: UnitQuaternion<f64> = LieGroup::exp(&(turn_rate * -self.at_s));
        let nobody = InertialParameters::from_vector(&SVector::zeros());
        let at_zero = back * nadir;
        let gravity = GravityGradient::of_point_mass(nobody, rate_rad_s * rate_rad_s, at_zero, turn_rate);
        Ok(GravityGradient { reference_world: vector("gravity_gradient.center_m", self.center_m)?, ..gravity })
    }
}

impl ConstantTable {
    fn wrench(&self, table: &str) -> Result<Wrench<f64>, ImpossibleNumber> {
        let of = |key: &str, numbers| vector(&format!("{table}.{key}"), numbers);
        Ok(Wrench::new(of("torque_n_m", self.torque_n_m)?, of("force_n", self.force_n)?))
    }
}

fn impossible(key: &str, message: String) -> ImpossibleNumber {
    ImpossibleNumber { key: key.to_owned(), message }
}

fn coefficient(key: &str, value: f64) -> Result<f64, ImpossibleNumber> {
    if (0.0..=MOST).contains(&value) { Ok(value) } else { Err(impossible(key, format!("{value}: 0 to {MOST:.0e}"))) }
}

fn vector(key: &str, numbers: [f64; 3]) -> Result<Vector3<f64>, ImpossibleNumber> {
    match numbers.iter().find(|number| !(-MOST..=MOST).contains(*number)) {
        None => Ok(Vector3::from(numbers)),
        Some(number) => Err(impossible(key, format!("{number}: each number -{MOST:.0e} to {MOST:.0e}"))),
    }
}

fn direction(key: &str, numbers: [f64; 3]) -> Result<Vector3<f64>, ImpossibleNumber> {
    let shortest = 1e-6;
    vector(key, numbers)?
        .try_normalize(shortest)
        .ok_or_else(|| impossible(key, format!("a direction is longer than {shortest:.0e}, as [0.0, 0.0, 1.0] is")))
}

#[derive(Serialize, Deserialize)]
struct File {
    format: u32,
    #[serde(flatten)]
    environment: toml::Table,
}

/// Reads and checks a file.
///
/// # Errors
/// [`FormatsError::Unreadable`], [`FormatsError::BadToml`] naming the key.
pub fn read(path: &Path) -> Result<Environment, FormatsError> {
    let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
    parse(&text, path)
}

/// From the text of the file `path`.
///
/// # Errors
/// As [`read`].
///
/// # Example
/// ```
/// use tumble_formats::environment_file;
/// let text = "format = 1\n[linear_drag]\nforce_n_s_m = 0.3\nwind_m_s = [0.1, 0.0, 0.0]\n";
/// assert!(!environment_file::parse(text, "environment.toml".as_ref())?.is_empty());
/// # Ok::<(), tumble_formats::FormatsError>(())
/// ```
pub fn parse(text: &str, path: &Path) -> Result<Environment, FormatsError> {
    let bad = |message: String| FormatsError::BadToml { path: path.into(), message };
    let file: File = toml_text::read(text).map_err(|error| bad(error.to_string()))?;
    if file.format != 1 {
        return Err(bad(format!("`format = {}`; this version reads 1", file.format)));
    }
    let written = toml::to_string(&file.environment).map_err(|error| bad(error.to_string()))?;
    let table: EnvironmentTable = toml_text::read(&written).map_err(|error| match error {
        TomlError::TooLong { message, .. } => bad(message),
        unlike => bad(place::with_suggestion(&unlike.message())),
    })?;
    let environment = table.environment().map_err(|error| {
        let (line, column) = place::of_key(text, &error.key);
        bad(format!("line {line}, column {column}: {error}"))
    })?;
    if environment.is_empty() {
        let tables = "`gravity_gradient`, `linear_drag`, `quadratic_drag`, `constant_body`, `constant_world`";
        return Err(bad(format!("nothing acts; write one of the tables {tables}")));
    }
    Ok(environment)
}

/// The text of a file.
///
/// # Errors
/// [`FormatsError::BadToml`] for numbers that TOML cannot hold.
pub fn text(table: &EnvironmentTable, path: &Path) -> Result<String, FormatsError> {
    let keys = toml::to_string(table)
        .map_err(|error| FormatsError::BadToml { path: path.into(), message: error.to_string() })?;
    Ok(format!("format = 1\n\n{keys}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use tumble_dynamics::nalgebra::Matrix3;
    use tumble_dynamics::{RigidBodyState, WrenchModel as _};
    use tumble_lie::{Pose, Twist};

    fn parsed(text: &str) -> Result<Environment, FormatsError> {
        parse(&format!("format = 1\n{text}"), Path::new("environment.toml"))
    }

    fn refused(text: &str) -> String {
        parsed(text).unwrap_err().to_string()
    }

    fn moving() -> RigidBodyState<f64> {
        let twist_body = Twist::new(Vector3::new(0.1, 0.2, -0.1), Vector3::new(0.3, 0.0, -0.2));
        RigidBodyState { world_from_body: Pose::translation(1.0, 2.0, 3.0), twist_body }
    }

    fn close(found: Wrench<f64>, torque: [f64; 3], force: [f64; 3]) {
        let expected = Wrench::new(Vector3::from(torque), Vector3::from(force));
        assert!((found - expected).to_vector().amax() < 1e-12, "{found:?} {expected:?}");
    }

    /// A dumbbell of two kilograms half a metre apart along x, 2 m beside the point that falls: nadir along z pulls apart along z with
    /// 2 n^2, and together along the rest with n^2.
    #[test]
    fn a_dumbbell_is_pulled_apart_along_the_vertical() {
        let text = "[gravity_gradient]\nrate_rad_s = 0.1\ncenter_m = [1.0, 0.0, 3.0]\n";
        let mass = |x: f64| InertialParameters::about_com(1.0, Vector3::new(x, 0.0, 0.0), Matrix3::zeros());
        let dumbbell = mass(-0.25) + mass(0.25);
        let mut state = moving();
        close(parsed(text).unwrap().wrench_on(&dumbbell, 5.0, &state), [0.0; 3], [0.0, -0.04, 0.0]);
        // turned about y, so that one end is lower: 3 n^2 m l^2 sin cos at both
        state.world_from_body.rotation = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.5);
        let torque = 3.0 * 0.01 * 2.0 * 0.0625 * 0.5_f64.sin() * 0.5_f64.cos();
        let found = parsed(text).unwrap().wrench_on(&dumbbell, 5.0, &state);
        assert!((found.torque - Vector3::y() * torque).amax() < 1e-12, "{found:?} {torque}");
        // a quarter of an orbit about x later nadir is along -y
        let quarter_s = core::f64::consts::FRAC_PI_2 / 0.1;
        for (at_s, time_s) in [(0.0, quarter_s), (1e9, 1e9 + quarter_s)] {
            let text = format!("{text}orbit_normal = [2.0, 0.0, 0.0]\nat_s = {at_s:?}\n");
            let found = parsed(&text).unwrap().wrench_on(&dumbbell, time_s, &moving());
            assert!((found.force - Vector3::y() * 0.08).amax() < 1e-6, "{found:?}");
        }
        close(parsed(text).unwrap().wrench_body(5.0, &state), [0.0; 3], [0.0; 3]);
    }

    #[test]
    fn drags_and_constants_are_as_written() {
        let linear = "[linear_drag]\nforce_n_s_m = 2.0\ntorque_n_m_s_rad = 0.5\nwind_m_s = [0.1, 0.0, 0.0]\n";
        close(parsed(linear).unwrap().wrench_body(0.0, &moving()), [-0.05, -0.1, 0.05], [-0.4, 0.0, 0.4]);
        let lever = format!("{linear}center_of_pressure_m = [0.0, 0.0, 0.1]\n");
        // w x r = (0.02, -0.01, 0), r x f = 0.1 (-f_y, f_x, 0)
        close(parsed(&lever).unwrap().wrench_body(0.0, &moving()), [-0.052, -0.144, 0.05], [-0.44, 0.02, 0.4]);
        let quadratic = "[quadratic_drag]\nforce_n_s2_m2 = 2.0\nwind_m_s = [0.3, 0.0, 0.0]\n";
        close(parsed(quadratic).unwrap().wrench_body(0.0, &moving()), [0.0; 3], [0.0, 0.0, 0.08]);
        let both = "[constant_body]\ntorque_n_m = [0.0, 0.0, 1.0]\n[constant_world]\nforce_n = [1.0, 0.0, 0.0]\n";
        let mut state = moving();
        state.world_from_body.rotation =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), core::f64::consts::FRAC_PI_2);
        close(parsed(both).unwrap().wrench_body(0.0, &state), [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]);
    }

    #[test]
    fn a_written_table_reads_back() {
        let nadir = GravityGradientTable {
            rate_rad_s: 1.1e-3,
            nadir: [0.0, 1.0, 0.0],
            orbit_normal: Some([1.0, 0.0, 0.0]),
            at_s: 1.7e9,
            center_m: [1.0, 0.0, -2.0],
        };
        let constant_world = Some(ConstantTable { force_n: [0.1, 0.2, 0.3], torque_n_m: [0.0; 3] });
        let quadratic_drag = Some(QuadraticDragTable { force_n_s2_m2: 0.3, ..QuadraticDragTable::default() });
        let table = EnvironmentTable {
            gravity_gradient: Some(nadir),
            quadratic_drag,
            constant_world,
            ..EnvironmentTable::default()
        };
        let path = Path::new("environment.toml");
        let body = InertialParameters::solid_box(3.0, [0.3, 0.2, 0.5]);
        let acting = |environment: &Environment| environment.wrench_on(&body, 1.7e9 + 700.0, &moving());
        let written = parse(&text(&table, path).unwrap(), path).unwrap();
        assert_eq!(acting(&written), acting(&table.environment().unwrap()));
    }

    #[test]
    fn impossible_values_are_named_with_their_place() {
        let gradient = "[gravity_gradient]\nrate_rad_s = 0.001\n";
        for (text, said) in [
            (
                "[gravity_gradient]\nrate_rad_s = 0.0\n".to_owned(),
                "line 3, column 1: `gravity_gradient.rate_rad_s`: 0:",
            ),
            ("[gravity_gradient]\nrate_rad_s = 7\n".to_owned(), "at most 1 rad/s"),
            (format!("{gradient}nadir = [0, 0, 0]\n"), "line 4, column 1: `gravity_gradient.nadir`"),
            (format!("{gradient}orbit_normal = [0, 1, 1]\n"), "square to `nadir`, not at a cosine of 0.707"),
            (format!("{gradient}at_s = nan\n"), "`gravity_gradient.at_s`: NaN"),
            (format!("{gradient}nadir = [0, 0, 1, 0]\n"), "`gravity_gradient.nadir` holds 4"),
            (format!("{gradient}nadr = [0, 0, 1]\n"), "did you mean `nadir`"),
            ("[gravity_gradient]\n".to_owned(), "rate_rad_s"),
            ("[linear_drag]\nforce_n_s_m = -1.0\n".to_owned(), "line 3, column 1: `linear_drag.force_n_s_m`: -1"),
            ("[quadratic_drag]\nwind_m_s = [inf, 0, 0]\n".to_owned(), "`quadratic_drag.wind_m_s`: inf"),
            ("[constant_world]\nforce_n = [1e9, 0, 0]\n".to_owned(), "`constant_world.force_n`: 1000000000"),
            ("[linear_drg]\n".to_owned(), "did you mean `linear_drag`"),
            (String::new(), "nothing acts; write one of the tables `gravity_gradient`"),
        ] {
            let found = refused(&text);
            assert!(found.contains(said), "{text}: {found}");
        }
        let old = parse("format = 2\n", Path::new("environment.toml")).unwrap_err().to_string();
        assert!(old.contains("`format = 2`; this version reads 1"), "{old}");
        assert!(parse("", Path::new("environment.toml")).unwrap_err().to_string().contains("format"));
    }
}
