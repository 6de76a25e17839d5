//! `tumble identify --model`: bodies of an arm and what it grasps, from logs of its joints.

use super::{Outcome, print};
use crate::output::{OutputFolder, RUN_RECORD};
use crate::{TumbleError, report};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use tumble_dynamics::InertialParameters;
use tumble_dynamics::nalgebra::{Matrix3, Vector3};
use tumble_formats::FormatsError;
use tumble_formats::Robots;
use tumble_formats::arm::{ArmModel, BaseKind};
use tumble_formats::body_file::rows;
use tumble_formats::log;
use tumble_formats::log::{JointLog, JointRow};
use tumble_identification::StandardDeviations;
use tumble_identification::estimator::Verdict;
use tumble_identification::multibody::{
    Drive, GainRegression, JointNuisance, JointTrack, MomentumForm, TorqueForm, TreeEstimate, TreeEstimator, TreePart,
    TreeRecord, TreeSample, VelocityNoise, with_accelerations,
};
use tumble_lie::{Pose, Twist, Wrench};

/// Errors are taken as dependent within this long, s, where motors answer.
const DEPENDENCE_S: f64 = 1.0;

/// Options of `tumble identify` for arms.
#[derive(Args, Clone)]
pub struct ArmOptions {
    /// The arm that the log is of: embedded (`tumble arm list`), TOML or URDF; asks for its bodies.
    #[arg(long, value_name = "ARM")]
    model: Option<String>,
    /// A log of the same arm while it carries the payload.
    #[arg(long, value_name = "LOG", requires = "model")]
    grasped: Option<PathBuf>,
    /// LOG itself is of the arm with the payload.
    #[arg(long, requires = "model", conflicts_with = "grasped")]
    payload: bool,
    /// Bodies that are asked for besides the payload: `all`, `none`, or names; unless given, those that the model does not know.
    #[arg(long, value_name = "BODIES", value_delimiter = ',', requires = "model")]
    unknown: Vec<String>,
    /// Equations: momentum of a free base, torques of the motors, or both.
    #[arg(long, value_enum, default_value_t = FormName::Auto, requires = "model")]
    form: FormName,
    /// Momentum about the world's origin at the first row: `zero`, `unknown`, or six numbers (angular, linear; N m s, N s).
    #[arg(long, value_name = "MOMENTUM", default_value = "unknown", value_parser = parse_momentum, allow_hyphen_values = true, requires = "model")]
    momentum: StartMomentum,
    /// Noise of rate (rad/s) and velocity (m/s) of the base and of joint rates, one sigma.
    #[arg(long, value_name = "RATE,VELOCITY,JOINTS", default_value = "1e-3,1e-3,1e-4", value_parser = parse_noise, requires = "model")]
    velocity_noise: VelocityNoise,
    /// Mass of the payload from a scale, kg: calibrates the gains of drives whose currents were logged.
    #[arg(long, value_name = "KG", requires = "model")]
    weighed: Option<f64>,
}

impl ArmOptions {
    /// Whether the log is of an arm.
    pub fn is_asked(&self) -> bool {
        self.model.is_some()
    }

    /// Whether a payload is asked for.
    fn carries(&self) -> bool {
        self.payload || self.grasped.is_some()
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum FormName {
    /// Momentum for a free base, torques for a fixed one.
    Auto,
    /// Momentum of the whole robot.
    Momentum,
    /// Motors' torques or currents (and the wrench on the base).
    Torque,
    /// Both.
    Both,
}

/// What is known of the momentum at the start.
#[derive(Clone, Copy, Debug, PartialEq)]
struct StartMomentum(Option<Wrench<f64>>);

fn parse_momentum(text: &str) -> Result<StartMomentum, String> {
    let numbers: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|x: &f64| x.is_finite())).collect();
    match (text, numbers.as_deref()) {
        ("zero", _) => Ok(StartMomentum(Some(Wrench::zero()))),
        ("unknown", _) => Ok(StartMomentum(None)),
        (_, Some([a, b, c, d, e, f])) => {
            Ok(StartMomentum(Some(Wrench::new(Vector3::new(*a, *b, *c), Vector3::new(*d, *e, *f)))))
        }
        _ => Err("`zero`, `unknown` or six numbers are needed, such as 0.1,0,0,0.5,0,0".to_owned()),
    }
}

fn parse_noise(text: &str) -> Result<VelocityNoise, String> {
    let positive = |part: &str| part.trim().parse().ok().filter(|x: &f64| *x > 0.0 && x.is_finite());
    let numbers: Option<Vec<f64>> = text.split(',').map(positive).collect();
    match numbers.as_deref() {
        Some([base_rate_rad_s, base_velocity_m_s, joint_rate]) => Ok(VelocityNoise {
            base_rate_rad_s: *base_rate_rad_s,
            base_velocity_m_s: *base_velocity_m_s,
            joint_rate: *joint_rate,
        }),
        _ => Err("three positive numbers are needed, such as 1e-3,1e-3,1e-4".to_owned()),
    }
}

/// Where a run reads and writes.
pub struct Files<'a> {
    /// The log.
    pub log: &'a Path,
    /// Whether rows may be put in order.
    pub reorder: bool,
    /// JSON on stdout.
    pub json: bool,
    /// Result folder.
    pub out: Option<&'a Path>,
    /// Whether to replace it.
    pub force: bool,
}

/// Which equations are used.
#[derive(Clone, Copy)]
struct Forms {
    momentum: bool,
    torque: bool,
}

fn refused(message: impl Into<String>) -> TumbleError {
    TumbleError::BadOption { message: message.into() }
}

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input; what is not identified is [`Outcome::NotAchieved`].
pub fn run(options: &ArmOptions, files: &Files<'_>, robots: &Robots) -> Result<Outcome, TumbleError> {
    let arm = ArmModel::find(options.model.as_deref().unwrap_or_default(), robots)?;
    let folder = files.out.map(|out| OutputFolder::create(out, files.force)).transpose()?;
    let mut warnings = arm.warnings.clone();
    let mut logs = vec![(files.log, options.payload)];
    logs.extend(options.grasped.as_deref().map(|log| (log, true)));
    let forms = forms(options, &arm)?;
    let carries = options.carries();
    let asked = asked_bodies(options, &arm, carries)?;
    let mut records = Vec::new();
    let mut currents = false;
    for (path, grasped) in logs {
        let log = JointLog::read(path, &arm, files.reorder)?;
        warnings.extend(log.warnings.iter().cloned());
        currents |=
            log.rows.iter().all(|row| row.torques.is_none()) && log.rows.iter().any(|row| row.currents.is_some());
        records.push(TreeRecord { samples: samples(path, &log.rows, &arm, forms)?, grasped });
    }
    let estimator = estimator(options, &arm, forms, currents, &asked)?;
    let estimate = estimator.identify(&records)?;
    let verdict = estimator.verdict(&records, &estimate)?;
    let report = Report { arm: &arm, estimator: &estimator, estimate: &estimate, verdict, forms, warnings };
    for warning in &report.warnings {
        tell_line!("warning: {warning}");
    }
    let object = report.json()?;
    let told = print(&if files.json { format!("{object}\n") } else { report.table()? });
    if let Some(folder) = folder {
        folder.write("result.json", &format!("{object:#}\n"))?;
        folder.write(RUN_RECORD, &run_record(files.log, options.grasped.as_deref())?)?;
        tell_line!("written: {}", folder.finish()?.display());
    }
    told?;
    Ok(if verdict.is_identified() { Outcome::Achieved } else { Outcome::NotAchieved })
}

fn forms(options: &ArmOptions, arm: &ArmModel) -> Result<Forms, TumbleError> {
    let free = arm.base_kind == BaseKind::Free;
    let forms = match options.form {
        FormName::Auto => Forms { momentum: free, torque: !free },
        FormName::Momentum => Forms { momentum: true, torque: false },
        FormName::Torque => Forms { momentum: false, torque: true },
        FormName::Both => Forms { momentum: true, torque: true },
    };
    if forms.momentum && !free {
        return Err(refused(format!(
            "`--form`: the base of `{}` is fixed, its momentum is not kept; use torque",
            arm.name
        )));
    }
    if !forms.momentum && options.momentum.0.is_some() {
        return Err(refused(
            "`--momentum` is used by the momentum form only: leave it out, or `--form both` of a free base",
        ));
    }
    Ok(forms)
}

/// The bodies asked for besides a payload.
fn asked_bodies(options: &ArmOptions, arm: &ArmModel, carries: bool) -> Result<Vec<usize>, TumbleError> {
    // on a fixed base nothing tells the base body
    let first = usize::from(arm.base_kind == BaseKind::Fixed);
    let name = |body: usize| arm.body_name(body).unwrap_or_default().to_owned();
    let bodies = first..arm.tree.bodies();
    let asked: Vec<usize> = match options.unknown.iter().map(String::as_str).collect::<Vec<_>>().as_slice() {
        [] => bodies.filter(|body| !arm.body_known(*body)).collect(),
        ["all"] => bodies.collect(),
        ["none"] => Vec::new(),
        names => names
            .iter()
            .map(|wanted| {
                bodies.clone().find(|body| name(*body) == *wanted).ok_or_else(|| {
                    let known: Vec<String> = bodies.clone().map(name).collect();
                    refused(format!("`--unknown {wanted}`: the arm has the bodies {}", known.join(", ")))
                })
            })
            .collect::<Result<_, _>>()?,
    };
    if asked.is_empty() && !carries {
        return Err(refused(
            "the model knows all bodies: name some with `--unknown`, or say that the arm carries something (`--payload`, `--grasped LOG`)",
        ));
    }
    Ok(asked)
}

/// The unknown parts and what is used to find them.
fn estimator(
    options: &ArmOptions,
    arm: &ArmModel,
    forms: Forms,
    currents: bool,
    asked: &[usize],
) -> Result<TreeEstimator, TumbleError> {
    let carries = options.carries();
    let name = |body: usize| arm.body_name(body).unwrap_or_default().to_owned();
    let rough = |kg: f64, size_m: f64| {
        InertialParameters::about_com(kg, Vector3::zeros(), Matrix3::identity() * (kg * size_m * size_m))
    };
    let part = |body: &usize| {
        let nominal =
            arm.tree.body(*body).filter(|_| arm.body_known(*body)).copied().unwrap_or_else(|| rough(3.0, 0.2));
        TreePart::whole(name(*body), *body, nominal)
    };
    let mut parts: Vec<TreePart> = asked.iter().map(part).collect();
    if carries {
        let tool = arm.tool.clone().ok_or_else(|| {
            refused(format!("the model of `{}` has no tool: say in `[tool]` where a payload is held", arm.name))
        })?;
        let mut payload = TreePart::payload("payload", tool.body, tool.body_from_frame, rough(1.0, 0.1));
        payload.weighed_kg = options.weighed.map(|kg| (kg, 1e-3 * kg));
        parts.push(payload);
    } else if options.weighed.is_some() {
        return Err(refused(
            "`--weighed` is the mass of a payload: say which log carries it (`--payload`, `--grasped LOG`)",
        ));
    }
    let torque = forms.torque.then(|| torque_form(options, arm, currents, asked.is_empty())).transpose()?;
    let momentum = forms.momentum.then_some(MomentumForm { noise: options.velocity_noise, known: options.momentum.0 });
    let dependence_s = if forms.torque { DEPENDENCE_S } else { 0.0 };
    Ok(TreeEstimator { tree: arm.tree.clone(), parts, momentum, torque, dependence_s })
}

fn torque_form(
    options: &ArmOptions,
    arm: &ArmModel,
    currents: bool,
    bodies_known: bool,
) -> Result<TorqueForm, TumbleError> {
    let drive = if currents {
        let gains: Option<Vec<_>> = arm.joints.iter().map(|joint| joint.drive_gain).collect();
        let gains = gains.ok_or_else(|| {
            refused("the log has currents, but the model no `drive_gain_n_m_per_a` for every joint: state them")
        })?;
        let std = |gain: &tumble_formats::arm::DriveGain| match options.weighed {
            Some(_) => f64::INFINITY,
            None => gain.std_n_m_per_a.unwrap_or(0.0),
        };
        Drive::Current { gain: gains.iter().map(|g| g.gain_n_m_per_a).collect(), std: gains.iter().map(std).collect() }
    } else if options.weighed.is_some() {
        return Err(refused("`--weighed` calibrates drives, but the log has torques: leave it out"));
    } else {
        Drive::Force
    };
    // with all bodies known, rotors cannot be told from them and are the model's
    let rotors = |nuisance: &JointNuisance| !(bodies_known && *nuisance == JointNuisance::RotorInertia);
    let nuisances = JointNuisance::ALL.into_iter().filter(rotors).collect();
    let gain_regression = GainRegression::ErrorsInVariables;
    Ok(TorqueForm { drive, nuisances, std: None, base_wrench_std: None, gain_regression })
}

/// The rows as the estimator takes them.
fn samples(path: &Path, rows: &[JointRow], arm: &ArmModel, forms: Forms) -> Result<Vec<TreeSample>, TumbleError> {
    let missing = |column: &str, because: &'static str| FormatsError::MissingColumn {
        path: path.to_owned(),
        column: column.to_owned(),
        because,
    };
    #[allow(clippy::cast_precision_loss, reason = "seconds")]
    let seconds = |row: &JointRow| (row.time_ns - rows.first().map_or(0, |first| first.time_ns)) as f64 * 1e-9;
    let motors = |row: &JointRow| row.torques.clone().or_else(|| row.currents.clone());
    if arm.base_kind == BaseKind::Fixed {
        let lists = |list: &dyn Fn(&JointRow) -> Option<Vec<f64>>| -> Option<Vec<Vec<f64>>> {
            let rows: Vec<Vec<f64>> = rows.iter().map(list).collect::<Option<_>>()?;
            Some((0..arm.joints.len()).map(|joint| rows.iter().map(|row| row[joint]).collect()).collect())
        };
        let track = JointTrack {
            times_s: rows.iter().map(seconds).collect(),
            positions: lists(&|row| Some(row.positions.clone())).unwrap_or_default(),
            rates: lists(&|row| row.rates.clone()),
            motors: lists(&motors)
                .ok_or_else(|| missing("tau1 or i1", "; a fixed arm is identified from its motors"))?,
            smooth_motors: false,
        };
        return Ok(track.on_fixed_base(&arm.gravity_world_m_s2)?);
    }
    let sample = |row: &JointRow| -> Result<TreeSample, TumbleError> {
        let because = "; a free base is identified from its pose, rate and velocity and from joint rates";
        let pose: Pose<f64> = row.world_from_base.ok_or_else(|| missing("p_x", because))?;
        let twist: Twist<f64> = row.base_twist().ok_or_else(|| missing("v_x or w_x", because))?;
        Ok(TreeSample {
            time_s: seconds(row),
            world_from_base: pose,
            base_twist: twist,
            positions: row.positions.clone(),
            rates: row.rates.clone().ok_or_else(|| missing("qd1", because))?,
            accelerations: None,
            motors: motors(row),
            base_wrench: row.base_wrench,
        })
    };
    let samples = rows.iter().map(sample).collect::<Result<Vec<_>, _>>()?;
    if !forms.torque {
        return Ok(samples);
    }
    if samples.iter().all(|sample| sample.motors.is_none()) {
        return Err(missing("tau1 or i1", "; the torque form needs the motors").into());
    }
    Ok(with_accelerations(&samples, &arm.gravity_world_m_s2)?)
}

/// What was found, to be told.
struct Report<'a> {
    arm: &'a ArmModel,
    estimator: &'a TreeEstimator,
    estimate: &'a TreeEstimate,
    verdict: Verdict,
    forms: Forms,
    warnings: Vec<String>,
}

impl Report<'_> {
    fn std(&self, part: usize) -> Result<Option<StandardDeviations>, TumbleError> {
        Ok(self.estimate.body_std(part)?)
    }

    fn equations(&self) -> &'static str {
        match (self.forms.momentum, self.forms.torque) {
            (true, true) => "momentum and torque",
            (true, false) => "momentum",
            _ => "torque",
        }
    }

    /// Unknowns of the momentum and the drives are not told apart from bodies by these words alone, so all are listed.
    fn null_directions(&self) -> Vec<String> {
        self.estimate.base.indistinguishable_changes().iter().map(ToString::to_string).collect()
    }

    fn nuisances(&self) -> Vec<(String, String, f64, Option<f64>)> {
        let layout = self.estimate.base.layout();
        let value = |index: usize| self.estimate.links.nuisance(index).unwrap_or(f64::NAN);
        let all = layout.nuisances().iter().enumerate();
        all.map(|(index, nuisance)| {
            let std = self.estimate.nuisance(&nuisance.name).map(|(_, std)| std);
            (nuisance.name.clone(), nuisance.unit.clone(), value(index), std)
        })
        .collect()
    }

    fn json(&self) -> Result<Value, TumbleError> {
        let mut bodies = Vec::new();
        for (index, part) in self.estimator.parts.iter().enumerate() {
            let body = self.estimate.body(index).unwrap_or(part.nominal);
            let figures = json!({
                "mass_kg": body.mass,
                "com_m": body.center_of_mass().as_slice(),
                "inertia_about_com_kg_m2": rows(&body.inertia_about_com()),
            });
            let (told, std, regularised) = if let Some(std) = self.std(index)? {
                let std = json!({
                    "mass_kg": std.mass_kg,
                    "com_m": std.center_of_mass_m.as_slice(),
                    "inertia_about_com_kg_m2": rows(&std.inertia_about_com_kg_m2),
                });
                (figures, std, Value::Null)
            } else {
                let none = json!({"mass_kg": null, "com_m": null, "inertia_about_com_kg_m2": null});
                (none, Value::Null, figures)
            };
            let mut object = told;
            object["name"] = json!(part.name);
            object["std"] = std;
            object["regularised"] = regularised;
            bodies.push(object);
        }
        let nuisances: Vec<Value> = self
            .nuisances()
            .into_iter()
            .map(
                |(name, unit, value, std)| json!({"name": name, "unit": unit, "value": std.map(|_| value), "std": std}),
            )
            .collect();
        let base = &self.estimate.base;
        let base_parameters: Vec<Value> = base
            .base_parameters()
            .iter()
            .zip(base.estimates().iter())
            .map(|(parameter, value)| json!({"combination": parameter.to_string(), "value": value}))
            .collect();
        Ok(json!({
            "format": 1,
            "model": self.arm.name,
            "method": self.equations(),
            "equations": self.estimate.rows,
            "unknowns": base.layout().unknowns(),
            "identified": self.verdict.is_identified(),
            "doubt": report::doubted(self.verdict),
            "rank": base.rank(),
            "null_directions": self.null_directions(),
            "base_parameters": base_parameters,
            "bodies": bodies,
            "nuisances": nuisances,
            "motor_std": self.estimate.motor_std,
            "warnings": self.warnings,
        }))
    }

    fn table(&self) -> Result<String, TumbleError> {
        let mut text = String::new();
        let base = &self.estimate.base;
        let _ = writeln!(
            text,
            "{}: {} of {} unknowns determined, from {} equations of {}",
            self.arm.name,
            base.rank(),
            base.layout().unknowns(),
            self.estimate.rows,
            self.equations(),
        );
        for (index, part) in self.estimator.parts.iter().enumerate() {
            let Some(body) = self.estimate.body(index) else { continue };
            let (c, j) = (body.center_of_mass(), body.inertia_about_com());
            let _ = writeln!(text, "\n{}", part.name);
            match self.std(index)? {
                Some(std) => {
                    let (s, t) = (std.center_of_mass_m, std.inertia_about_com_kg_m2);
                    let _ = writeln!(text, "  mass        {:>11.5} +- {:.2e} kg", body.mass, std.mass_kg);
                    for (axis, k) in [("x", 0), ("y", 1), ("z", 2)] {
                        let _ = writeln!(text, "  CoM {axis}       {:>11.5} +- {:.2e} m", c[k], s[k]);
                    }
                    for (name, (a, b)) in
                        [("xx", (0, 0)), ("yy", (1, 1)), ("zz", (2, 2)), ("xy", (0, 1)), ("xz", (0, 2)), ("yz", (1, 2))]
                    {
                        let _ = writeln!(
                            text,
                            "  inertia {name}  {:>11.6} +- {:.2e} kg m^2 about the CoM",
                            j[(a, b)],
                            t[(a, b)]
                        );
                    }
                }
                None => {
                    let _ = writeln!(text, "  not determined by itself: see below");
                }
            }
        }
        let told: Vec<_> = self.nuisances().into_iter().filter_map(|(n, u, v, s)| Some((n, u, v, s?))).collect();
        if !told.is_empty() {
            let _ = writeln!(text);
        }
        for (name, unit, value, std) in told {
            let _ = writeln!(text, "{name:<34} {value:>11.4} +- {std:.2e} {unit}");
        }
        let identified = if self.estimator.parts.iter().all(|part| part.whole) {
            "all that such a motion tells of the bodies identified"
        } else {
            "all ten parameters of the payload identified"
        };
        let _ = writeln!(text, "\nverdict: {}", report::said(self.verdict, identified.to_owned(), "a quantity"));
        let directions = self.null_directions();
        if !directions.is_empty() {
            let _ = writeln!(text, "\nwhat these logs cannot tell apart:");
            for direction in directions {
                let _ = writeln!(text, "  {direction}");
            }
        }
        Ok(text)
    }
}

fn run_record(own: &Path, grasped: Option<&Path>) -> Result<String, TumbleError> {
    let options: Vec<String> = std::env::args().skip(1).collect();
    Ok(json!({
        "format": 1,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": option_env!("TUMBLE_COMMIT"),
        "command": "identify",
        "configuration": options,
        "seed": null,
        "input_hash": { "log": log::hash(own)?, "grasped": grasped.map(log::hash).transpose()? },
    })
    .to_string())
}
