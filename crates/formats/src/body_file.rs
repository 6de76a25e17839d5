//! Bodies as files: TOML and JSON in and out, URDF and MJCF out.

use crate::FormatsError;
use crate::text_file::{self, printable};
use crate::toml_text;
use serde::{Deserialize, Serialize};
use std::path::Path;
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{Matrix3, SVector, Vector3};
use tumble_identification::Prior;

/// A rigid body as a user writes it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyFile {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in body axes from the body origin, m.
    pub com_m: [f64; 3],
    /// Inertia tensor about the centre of mass, body axes, kg m^2; off-diagonals are minus the products of inertia.
    pub inertia_about_com_kg_m2: [[f64; 3]; 3],
}

impl From<&InertialParameters<f64>> for BodyFile {
    fn from(body: &InertialParameters<f64>) -> Self {
        Self {
            mass_kg: body.mass,
            com_m: body.center_of_mass().into(),
            inertia_about_com_kg_m2: rows(&body.inertia_about_com()),
        }
    }
}

/// The rows of a matrix, as files write them.
pub fn rows(m: &Matrix3<f64>) -> [[f64; 3]; 3] {
    [[m.m11, m.m12, m.m13], [m.m21, m.m22, m.m23], [m.m31, m.m32, m.m33]]
}

impl BodyFile {
    /// The ten parameters, checked.
    ///
    /// # Errors
    /// [`FormatsError::ImpossibleBody`], naming `path`; [`FormatsError::BadToml`] for an asymmetric tensor.
    pub fn to_parameters(self, path: &Path) -> Result<InertialParameters<f64>, FormatsError> {
        let inertia = Matrix3::from_fn(|i, j| self.inertia_about_com_kg_m2[i][j]);
        if (inertia - inertia.transpose()).amax() > 1e-9 * inertia.amax() {
            return Err(FormatsError::BadToml {
                path: path.into(),
                message: "`inertia_about_com_kg_m2` is not symmetric".to_owned(),
            });
        }
        let body = InertialParameters::about_com(self.mass_kg, Vector3::from(self.com_m), inertia);
        body.validated().map_err(|source| FormatsError::ImpossibleBody { path: path.into(), source })
    }
}

/// Reads a body from TOML (or JSON by its extension).
///
/// # Errors
/// [`FormatsError`] naming the file and the key.
pub fn read(path: &Path) -> Result<InertialParameters<f64>, FormatsError> {
    parse(&text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?, path)
}

/// What stands in such a file, checked, as it stands there.
///
/// # Errors
/// As [`read`].
pub fn read_written(path: &Path) -> Result<BodyFile, FormatsError> {
    let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
    let body = written(&text, path)?;
    body.to_parameters(path).map(|_| body)
}

/// A body from the text of the file `path`.
///
/// # Errors
/// As [`read`].
pub fn parse(text: &str, path: &Path) -> Result<InertialParameters<f64>, FormatsError> {
    written(text, path)?.to_parameters(path)
}

fn written(text: &str, path: &Path) -> Result<BodyFile, FormatsError> {
    Ok(if extension(path) == "json" {
        serde_json::from_str(text)
            .map_err(|error| FormatsError::BadToml { path: path.into(), message: printable(&error.to_string()) })?
    } else {
        toml_text::read(text)
            .map_err(|error| FormatsError::BadToml { path: path.into(), message: error.to_string() })?
    })
}

/// Prior knowledge as a user writes it: a body and one sigma of each group of numbers.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PriorFile {
    mass_kg: f64,
    com_m: [f64; 3],
    inertia_about_com_kg_m2: [[f64; 3]; 3],
    /// One sigma of the mass, kg.
    mass_std_kg: f64,
    /// One sigma of each coordinate of the centre of mass, m.
    com_std_m: f64,
    /// One sigma of each entry of the inertia, kg m^2.
    inertia_std_kg_m2: f64,
}

/// Reads prior knowledge of a body from TOML.
///
/// The sigma of the first moment follows from those of mass and centre of mass.
///
/// # Errors
/// [`FormatsError`] naming the file and the key.
pub fn read_prior(path: &Path) -> Result<Prior, FormatsError> {
    let text = text_file::read(path).map_err(|source| FormatsError::Unreadable { path: path.into(), source })?;
    let bad = |message: String| FormatsError::BadToml { path: path.into(), message };
    let file: PriorFile = toml_text::read(&text).map_err(|error| bad(error.to_string()))?;
    for (key, std) in [
        ("mass_std_kg", file.mass_std_kg),
        ("com_std_m", file.com_std_m),
        ("inertia_std_kg_m2", file.inertia_std_kg_m2),
    ] {
        if !(std > 0.0 && std.is_finite()) {
            return Err(bad(format!("`{key}` is {std}; a standard deviation is positive and finite")));
        }
    }
    let mean =
        BodyFile { mass_kg: file.mass_kg, com_m: file.com_m, inertia_about_com_kg_m2: file.inertia_about_com_kg_m2 }
            .to_parameters(path)?;
    let com = mean.center_of_mass();
    let first_moment_std = com.map(|c| (c * file.mass_std_kg).hypot(mean.mass * file.com_std_m));
    let inertia = file.inertia_std_kg_m2;
    let standard_deviation = SVector::from([
        file.mass_std_kg,
        first_moment_std.x,
        first_moment_std.y,
        first_moment_std.z,
        inertia,
        inertia,
        inertia,
        inertia,
        inertia,
        inertia,
    ]);
    Ok(Prior { mean, standard_deviation })
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

/// The text of a body in the format that the extension of `path` names.
///
/// # Errors
/// [`FormatsError::UnknownFormat`].
pub fn export(path: &Path, body: &InertialParameters<f64>) -> Result<String, FormatsError> {
    let file = BodyFile::from(body);
    let serialised = |message: String| FormatsError::BadToml { path: path.into(), message };
    match extension(path).as_str() {
        "toml" => toml::to_string_pretty(&file).map_err(|error| serialised(error.to_string())),
        "json" => serde_json::to_string_pretty(&file).map_err(|error| serialised(error.to_string())),
        "urdf" => Ok(urdf(&file)),
        "xml" | "mjcf" => Ok(mjcf(&file)),
        "yaml" | "yml" => Ok(inertia_message(&file)),
        "script" => Ok(payload_line(&file)),
        _ => Err(FormatsError::UnknownFormat {
            path: path.into(),
            known: "a body is exported to .toml, .json, .urdf, .xml (MJCF), .yaml (geometry_msgs/Inertia) or .script (set_target_payload)",
        }),
    }
}

/// The `<inertial>` of a link.
pub fn urdf(body: &BodyFile) -> String {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = body.inertia_about_com_kg_m2;
    let [x, y, z] = body.com_m;
    format!(
        "<inertial>\n  <origin xyz=\"{x} {y} {z}\" rpy=\"0 0 0\"/>\n  <mass value=\"{}\"/>\n  \
         <inertia ixx=\"{xx}\" ixy=\"{xy}\" ixz=\"{xz}\" iyy=\"{yy}\" iyz=\"{yz}\" izz=\"{zz}\"/>\n</inertial>\n",
        body.mass_kg
    )
}

/// The `<inertial>` of an MJCF body.
pub fn mjcf(body: &BodyFile) -> String {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = body.inertia_about_com_kg_m2;
    let [x, y, z] = body.com_m;
    format!("<inertial pos=\"{x} {y} {z}\" mass=\"{}\" fullinertia=\"{xx} {yy} {zz} {xy} {xz} {yz}\"/>\n", body.mass_kg)
}

/// A `geometry_msgs/Inertia` as `ros2 topic pub` takes it: the tensor about the centre of mass, its entries as they stand in the matrix.
fn inertia_message(body: &BodyFile) -> String {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = body.inertia_about_com_kg_m2;
    let [x, y, z] = body.com_m;
    format!(
        "m: {:?}\ncom:\n  x: {x:?}\n  y: {y:?}\n  z: {z:?}\nixx: {xx:?}\nixy: {xy:?}\nixz: {xz:?}\niyy: {yy:?}\niyz: {yz:?}\nizz: {zz:?}\n",
        body.mass_kg
    )
}

/// The line of a program of a UR arm that says what it holds, body axes those of its flange: mass, centre of mass, and
/// [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] about the centre of mass.
fn payload_line(body: &BodyFile) -> String {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = body.inertia_about_com_kg_m2;
    let [x, y, z] = body.com_m;
    format!(
        "set_target_payload({:?}, [{x:?}, {y:?}, {z:?}], [{xx:?}, {yy:?}, {zz:?}, {xy:?}, {xz:?}, {yz:?}])\n",
        body.mass_kg
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn body() -> InertialParameters<f64> {
        InertialParameters::about_com(
            9.41,
            Vector3::new(0.031, -0.017, 0.052),
            Matrix3::new(0.15, 0.01, -0.02, 0.01, 0.16, 0.005, -0.02, 0.005, 0.17),
        )
    }

    #[test]
    fn toml_and_json_round_trip() {
        for name in ["body.toml", "body.json"] {
            let path = crate::testing::scratch_file(name, export(Path::new(name), &body()).unwrap());
            let back = read(&path).unwrap();
            fs::remove_file(&path).unwrap();
            assert!((back.to_vector() - body().to_vector()).amax() < 1e-14);
        }
    }

    #[test]
    fn simulators_get_tensor_entries_in_their_order() {
        let urdf = export(Path::new("b.urdf"), &body()).unwrap();
        assert!(
            urdf.contains("ixy=\"0.01") && urdf.contains("iyz=\"0.005") && urdf.contains("value=\"9.41\""),
            "{urdf}"
        );
        let mjcf = export(Path::new("b.xml"), &body()).unwrap();
        let full = mjcf.split("fullinertia=\"").nth(1).unwrap().split('"').next().unwrap();
        let entries: Vec<f64> = full.split(' ').map(|t| t.parse().unwrap()).collect();
        for (found, expected) in entries.iter().zip([0.15, 0.16, 0.17, 0.01, -0.02, 0.005]) {
            assert!((found - expected).abs() < 1e-12, "{mjcf}");
        }
    }

    #[test]
    fn impossible_bodies_and_unknown_keys_are_refused() {
        let path = Path::new("body.toml");
        let plate = BodyFile {
            mass_kg: 1.0,
            com_m: [0.0; 3],
            inertia_about_com_kg_m2: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.1]],
        };
        assert!(matches!(plate.to_parameters(path), Err(FormatsError::ImpossibleBody { .. })));
        let skewed = BodyFile { inertia_about_com_kg_m2: [[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], ..plate };
        assert!(matches!(skewed.to_parameters(path), Err(FormatsError::BadToml { .. })));
        let text = "mass_kg = 1.0\ncom_m = [0, 0, 0]\nmas = 2\n";
        assert!(toml::from_str::<BodyFile>(text).is_err());
        assert!(matches!(export(Path::new("b.step"), &body()), Err(FormatsError::UnknownFormat { .. })));
    }
}
