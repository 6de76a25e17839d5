//! `tumble excite`: a motion that shows all ten parameters, and its simulated flight.

use super::excite_motion::{Bounds, Designed, FinePeriod, Flight};
use super::excite_options::CriterionName;
pub use super::excite_options::ExciteArgs;
use super::excite_page;
use super::said::progress;
use super::{Outcome, print};
use crate::output::{OutputFolder, RUN_RECORD, unused};
use crate::page::Page;
use crate::{TumbleError, flight_log, report, space_cobot};
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tumble_dynamics::nalgebra::{SVector, Vector6};
use tumble_dynamics::{FreeFlyer, InertialParameters, MuntheKaas4, PoseTracker, RigidBodyState, SimulatedBody};
use tumble_formats::body_file::{self, BodyFile};
use tumble_formats::excitation_file::{DesignTable, ExcitationFile, LimitsTable, NoiseTable};
use tumble_identification::excitation::{
    Channel, ChannelLimits, ExcitationDesign, ExcitationProblem, Execution, NormalizedCondition, PlanarExcitation,
    Saturation, SpaceExcitation, WrenchLimits, execute, samples_per_period,
};
use tumble_identification::fourier::{FourierBasis, FourierMotion};
use tumble_identification::harmonics::cramer_rao;
use tumble_identification::noise::Gaussian;
use tumble_identification::{
    AOptimality, BodyScale, ConditionNumber, DOptimality, EOptimality, IdentificationError, InLikeUnits, Noise,
};
use tumble_lie::{LieGroup, Pose};

/// V1's reward of a large motion, per root mean square of each channel, 1/m and 1/rad.
const V1_REWARD: f64 = 20.0;
/// The tracker's natural frequency, rad/s, and its largest share of the sampling rate.
const TRACKER: (f64, f64) = (4.0, 0.1);
/// Longest integration step of the flight, s.
const LARGEST_STEP_S: f64 = 0.01;
/// Longest flight that is simulated, samples.
const MOST_SAMPLES: usize = 2_000_000;
/// Most harmonics and starts that are searched.
const MOST_HARMONICS: usize = 30;
const MOST_STARTS: usize = 1000;
/// A search is heard of where nothing replaces lines, too, when it has taken this long, s.
const SILENCE_S: f64 = 5.0;
/// Harmonics that tracking with the wrong body adds.
const HARMONICS_ADDED: usize = 10;

/// Runs the command.
///
/// # Errors
/// [`TumbleError`] for bad input.
pub fn run(args: &ExciteArgs) -> Result<Outcome, TumbleError> {
    check(args)?;
    let samples = samples_per_period(args.period, 1.0 / args.rate).map_err(TumbleError::Excitation)?;
    if samples.saturating_mul(args.cycles) > MOST_SAMPLES {
        return Err(TumbleError::BadOption {
            message: format!("{} cycles of {samples} samples: at most {MOST_SAMPLES} in all", args.cycles),
        });
    }
    let place = match &args.out {
        Some(path) => path.clone(),
        None => unused(&Path::new("tumble-out").join(format!("excite-{}-{}", args.criterion.name(), args.seed))),
    };
    let folder = OutputFolder::create(&place, args.force)?;
    let body = args.body.as_deref().map_or_else(|| Ok(space_cobot::body()), body_file::read)?;
    let payload = args.payload.as_deref().map(body_file::read).transpose()?;
    progress(&format!("searching from {} start{} ...", args.starts, if args.starts == 1 { "" } else { "s" }));
    let designed = design(args, &body, samples).map_err(TumbleError::Excitation)?;
    let noise = Noise {
        torque_n_m: args.torque_noise,
        force_n: args.force_noise,
        attitude_rad: args.attitude_noise,
        position_m: args.position_noise,
        ..Noise::default()
    };
    let bound = |harmonics: usize| {
        let motion = designed.motion.extended_to(harmonics);
        cramer_rao(&motion, &body, samples, args.cycles - 1, &noise).map_err(TumbleError::Excitation)
    };
    let free_harmonics = (args.harmonics + HARMONICS_ADDED).min((samples - 1) / 2);
    let bounds = Bounds { exact: bound(args.harmonics)?, free: bound(free_harmonics)?, free_harmonics };
    let file = excitation_file(args, &designed, &body);
    let mut random = Gaussian::from_seed(args.seed);
    let flight = if args.fly {
        progress(&format!("flying {} cycles ...", args.cycles));
        Some(fly(args, &designed.motion, &body, payload, &mut random)?)
    } else {
        None
    };
    progress("");

    let period = FinePeriod::of(&designed.motion, &body);
    let summary = summary(args, &designed, &bounds, &period, flight.as_ref());
    folder.write("excitation.toml", &file.to_toml(&folder.file("excitation.toml"))?)?;
    folder.write("motion.csv", &motion_csv(&designed.motion, &body, samples))?;
    folder.write("summary.json", &format!("{summary:#}\n"))?;
    folder.write(RUN_RECORD, &run_record(args))?;
    let charts = excite_page::charts(&file.limits, &period);
    Page::chart_files(&folder, &charts)?;
    let timeless = table(args, &designed, &bounds, &period, flight.as_ref(), false);
    folder.write(
        "report.html",
        &excite_page::page(args, &designed, &bounds, body.mass, flight.as_ref(), &charts, &timeless),
    )?;
    if let Some(flight) = &flight {
        let measured = flight_log::measured(&flight.execution, &file.noise, &mut random);
        folder.write("log.csv", &flight_log::csv(&flight.execution, &measured))?;
        folder.write("truth.toml", &body_file::export(Path::new("truth.toml"), &flight.truth)?)?;
    }
    let place = folder.finish()?;
    let told = if args.json {
        let mut printed = summary;
        printed["folder"] = place.display().to_string().into();
        print(&format!("{printed}\n"))
    } else {
        print(&table(args, &designed, &bounds, &period, flight.as_ref(), true))
    };
    if flight.is_some() {
        let shown = place.display();
        tell_line!("wrote {shown}; tumble identify {shown}/log.csv --excitation {shown}/excitation.toml");
    } else {
        tell_line!("wrote {}", place.display());
    }
    told?;
    Ok(Outcome::Achieved)
}

/// Refuses values that mean nothing; limits that admit no motion are the design's to refuse.
fn check(args: &ExciteArgs) -> Result<(), TumbleError> {
    for (option, value) in [
        ("--period", args.period),
        ("--rate", args.rate),
        ("--position-noise", args.position_noise),
        ("--attitude-noise", args.attitude_noise),
        ("--force-noise", args.force_noise),
        ("--torque-noise", args.torque_noise),
    ] {
        if !(value > 0.0 && value.is_finite()) {
            return Err(TumbleError::BadOption { message: format!("`{option} {value}`: positive and finite") });
        }
    }
    for (option, value) in [("--force-limit", args.force_limit), ("--torque-limit", args.torque_limit)] {
        if value.is_nan() || value <= 0.0 {
            return Err(TumbleError::BadOption {
                message: format!("`{option} {value}` admits no motion: a limit is positive, or inf"),
            });
        }
    }
    for (option, count, most, because) in [
        ("--harmonics", args.harmonics, MOST_HARMONICS, "the time of a start grows with more than their square"),
        ("--starts", args.starts, MOST_STARTS, "each start is a search of its own"),
    ] {
        if count > most {
            return Err(TumbleError::SearchTooLong { option, count, most, because });
        }
    }
    for (option, count, least) in [("--starts", args.starts, 1), ("--cycles", args.cycles, 2)] {
        if count < least {
            return Err(TumbleError::BadOption { message: format!("`{option} {count}`: at least {least}") });
        }
    }
    Ok(())
}

/// Limits of all six channels.
fn channel_limits(args: &ExciteArgs) -> [ChannelLimits; 6] {
    let along = |distance: f64| ChannelLimits::symmetric(distance, args.speed, args.acceleration);
    let about = ChannelLimits::symmetric(args.angle, args.angular_rate, args.angular_acceleration);
    [along(args.position.x), along(args.position.y), along(args.position.z), about, about, about]
}

fn design(args: &ExciteArgs, body: &InertialParameters<f64>, samples: usize) -> Result<Designed, IdentificationError> {
    if args.harmonics < 2 {
        return Err(IdentificationError::NoFreeCoefficients { harmonics: args.harmonics });
    }
    let basis = FourierBasis::try_new(args.period, args.harmonics)?;
    let limits = channel_limits(args);
    let magnitudes = BodyScale::of(&body.to_vector())?.parameter_magnitudes();
    if args.planar {
        let problem = PlanarExcitation::try_new(basis, &[limits[0], limits[1], limits[5]], samples)?;
        // Mass, first moments in the plane, inertia about the axis across it.
        let magnitudes = SVector::from([magnitudes[0], magnitudes[1], magnitudes[2], magnitudes[9]]);
        search(args, problem, body, magnitudes)
    } else {
        search(args, SpaceExcitation::try_new(basis, &limits, samples)?, body, magnitudes)
    }
}

fn search<const P: usize>(
    args: &ExciteArgs,
    problem: ExcitationProblem<P>,
    body: &InertialParameters<f64>,
    magnitudes: SVector<f64, P>,
) -> Result<Designed, IdentificationError> {
    let (torque, force) = (args.torque_noise, args.force_noise);
    let mut problem = problem.with_wrench_noise(Vector6::new(torque, torque, torque, force, force, force))?;
    if !args.saturate {
        let limits = space_cobot::wrench_box(args.force_limit, args.torque_limit);
        problem = problem.with_wrench_limits(WrenchLimits::of_box(body, &limits)?);
    }
    let started = Instant::now();
    let (starts, seed) = (args.starts, args.seed);
    let report = |costs: &[Option<f64>]| {
        let least = costs.iter().flatten().copied().reduce(f64::min).map_or("none".to_owned(), significant);
        let text = format!("start {} of {starts} searched, least cost {least}", costs.len());
        if !std::io::stderr().is_terminal() && started.elapsed().as_secs_f64() > SILENCE_S {
            tell_line!("{text}");
        }
        progress(&text);
    };
    let found = match args.criterion {
        CriterionName::V1 => {
            problem.design_reporting(&NormalizedCondition { rms_weights: [V1_REWARD; 6] }, starts, seed, report)
        }
        CriterionName::D => {
            problem.design_reporting(&InLikeUnits { criterion: DOptimality, magnitudes }, starts, seed, report)
        }
        CriterionName::A => {
            problem.design_reporting(&InLikeUnits { criterion: AOptimality, magnitudes }, starts, seed, report)
        }
        CriterionName::E => {
            problem.design_reporting(&InLikeUnits { criterion: EOptimality, magnitudes }, starts, seed, report)
        }
        CriterionName::Condition => {
            problem.design_reporting(&InLikeUnits { criterion: ConditionNumber, magnitudes }, starts, seed, report)
        }
    };
    let ExcitationDesign { motion, cost, cost_per_start, utilization, .. } = found?;
    Ok(Designed { motion, cost, cost_per_start, utilization, duration_s: started.elapsed().as_secs_f64() })
}

fn excitation_file(args: &ExciteArgs, designed: &Designed, body: &InertialParameters<f64>) -> ExcitationFile {
    let limits = LimitsTable {
        position_m: args.position.into(),
        angle_rad: args.angle,
        speed_m_s: args.speed,
        angular_rate_rad_s: args.angular_rate,
        acceleration_m_s2: args.acceleration,
        angular_acceleration_rad_s2: args.angular_acceleration,
        force_n: args.force_limit,
        torque_n_m: args.torque_limit,
        wrench_in_design: !args.saturate,
    };
    let noise = NoiseTable {
        position_m: args.position_noise,
        attitude_rad: args.attitude_noise,
        force_n: args.force_noise,
        torque_n_m: args.torque_noise,
    };
    let design = DesignTable {
        criterion: args.criterion.name().to_owned(),
        starts: args.starts,
        seed: args.seed,
        planar: args.planar,
        cost: designed.cost,
    };
    ExcitationFile::new(&designed.motion, (args.cycles, args.rate), limits, noise, BodyFile::from(body), design)
}

/// A box of 0.7 to 1.6 kg held about 0.1 m from the robot's origin.
fn random_payload(random: &mut Gaussian) -> InertialParameters<f64> {
    let edges = [0.08 + 0.1 * random.uniform(), 0.08 + 0.1 * random.uniform(), 0.08 + 0.1 * random.uniform()];
    let payload = InertialParameters::solid_box(0.7 + 0.9 * random.uniform(), edges);
    let turn = <Pose<f64> as LieGroup>::exp(&Vector6::from_fn(|i, _| if i < 3 { 0.4 * random.normal() } else { 0.0 }));
    let place = random.vector(0.08);
    payload.transformed_by(&Pose::from_parts(place.into(), turn.rotation))
}

fn fly(
    args: &ExciteArgs,
    motion: &FourierMotion,
    body: &InertialParameters<f64>,
    payload: Option<InertialParameters<f64>>,
    random: &mut Gaussian,
) -> Result<Flight, TumbleError> {
    let payload = payload.unwrap_or_else(|| random_payload(random));
    let truth = *body + payload;
    let limits = space_cobot::wrench_box(args.force_limit, args.torque_limit);
    let step_s = 1.0 / args.rate;
    let mut plant =
        SimulatedBody::try_new(FreeFlyer::new(truth), MuntheKaas4, limits, RigidBodyState::at_rest(), LARGEST_STEP_S)?;
    let frequency = TRACKER.0.min(TRACKER.1 * args.rate);
    let tracker = PoseTracker::critically_damped(FreeFlyer::new(*body), frequency, frequency);
    let execution = execute(motion, &tracker, &mut plant, &Pose::identity(), args.cycles, step_s)
        .map_err(TumbleError::Excitation)?;
    let tracking_rms = tracking_rms(motion, &execution);
    Ok(Flight { truth, payload_kg: payload.mass, execution, tracking_rms })
}

fn tracking_rms(motion: &FourierMotion, flown: &Execution) -> (f64, f64) {
    let (mut distance, mut angle) = (0.0, 0.0);
    for sample in &flown.samples {
        let Some(wanted) = motion.at(sample.time_s) else { continue };
        let error = wanted.world_from_body.inv_mul(&sample.state.world_from_body);
        distance += error.translation.vector.norm_squared();
        angle += error.rotation.angle().powi(2);
    }
    let mean = |sum: f64| (sum / flown.samples.len().max(1) as f64).sqrt();
    (mean(distance), mean(angle))
}

/// One period, wrench of the body without payload; the end is the start of the next and absent.
fn motion_csv(motion: &FourierMotion, body: &InertialParameters<f64>, samples: usize) -> String {
    let mut text = "t_s,p_x,p_y,p_z,q_x,q_y,q_z,q_w,f_x,f_y,f_z,tau_x,tau_y,tau_z,v_x,v_y,v_z,w_x,w_y,w_z,a_x,a_y,a_z,\
                    alpha_x,alpha_y,alpha_z\n"
        .to_owned();
    let flyer = FreeFlyer::new(*body);
    for i in 0..samples {
        let time_s = motion.basis().period_s() * i as f64 / samples as f64;
        let Some(instant) = motion.at(time_s) else { continue };
        let reference = instant.reference(&Pose::identity());
        text += &flight_log::time_cell(flight_log::nanoseconds(time_s));
        flight_log::push_pose(&mut text, &instant.world_from_body);
        flight_log::push_wrench(&mut text, &flyer.inverse(&reference.state.twist_body, &reference.acceleration));
        let vectors = [
            instant.velocity_origin_world,
            instant.angular_velocity_body,
            instant.acceleration_origin_body(),
            instant.angular_acceleration_body,
        ];
        flight_log::push_numbers(&mut text, vectors.iter().flatten());
        text.push('\n');
    }
    text
}

fn summary(
    args: &ExciteArgs,
    designed: &Designed,
    bounds: &Bounds,
    period: &FinePeriod,
    flight: Option<&Flight>,
) -> serde_json::Value {
    let utilization: Vec<serde_json::Value> = designed
        .utilization
        .iter()
        .map(|used| {
            serde_json::json!({
                "channel": used.channel.to_string(),
                "limit": used.limit.to_string(),
                "share": used.share,
            })
        })
        .collect();
    serde_json::json!({
        "format": 1,
        "criterion": args.criterion.name(),
        "seed": args.seed,
        "period_s": args.period,
        "harmonics": args.harmonics,
        "cycles": args.cycles,
        "rate_hz": args.rate,
        "planar": args.planar,
        "cost": designed.cost,
        "cost_per_start": designed.cost_per_start,
        "utilization": utilization,
        "peak_torque_n_m": period.largest_torque(),
        "peak_force_n": period.largest_force(),
        "rank": bounds.exact.observability.rank(),
        "predicted_std": report::sigma_json(&bounds.exact.std),
        "predicted_std_exact_poses": report::sigma_json(&bounds.exact.std_of_known_motion),
        "free_harmonics": bounds.free_harmonics,
        "predicted_std_free_harmonics": report::sigma_json(&bounds.free.std),
        "flight": flight.map(|flight| {
            let Saturation { any, by_component } = flight.execution.saturation;
            serde_json::json!({
                "truth": BodyFile::from(&flight.truth),
                "saturation": { "any": any, "torque_xyz": &by_component[..3], "force_xyz": &by_component[3..] },
                "rms_tracking_m": flight.tracking_rms.0,
                "rms_tracking_rad": flight.tracking_rms.1,
            })
        }),
    })
}

fn table(
    args: &ExciteArgs,
    designed: &Designed,
    bounds: &Bounds,
    period: &FinePeriod,
    flight: Option<&Flight>,
    is_timed: bool,
) -> String {
    let mut text = String::new();
    // How long it took is no part of a page that the same seed makes again.
    let took = if is_timed { format!(", {:.0} ms", 1e3 * designed.duration_s) } else { String::new() };
    let _ = writeln!(
        text,
        "excitation by criterion {}: {} harmonics, {} s, {}; seed {}{took}",
        args.criterion.name(),
        args.harmonics,
        args.period,
        if args.planar { "x, y and yaw" } else { "all six channels" },
        args.seed
    );
    let costs: Vec<String> =
        designed.cost_per_start.iter().map(|cost| cost.map_or("none".to_owned(), significant)).collect();
    let _ = writeln!(text, "  cost {}; from each start: {}\n", significant(designed.cost), costs.join(", "));
    let [value, rate, acceleration] = &period.channels;
    let _ = writeln!(
        text,
        "  {:<8}{:>10}{:>9}{:>12}{:>9}{:>14}{:>9}",
        "channel", "peak", "limit", "peak rate", "limit", "peak accel.", "limit"
    );
    for (i, (channel, limits)) in Channel::ALL.iter().zip(channel_limits(args)).enumerate() {
        if args.planar && !Channel::PLANAR.contains(channel) {
            continue;
        }
        let unit = if i < 3 { "m" } else { "rad" };
        let _ = writeln!(
            text,
            "  {:<8}{:>10.3}{:>9.3}{:>12.3}{:>9.3}{:>14.3}{:>9.3}  {unit}, {unit}/s, {unit}/s^2",
            channel.to_string(),
            value.column(i).amax(),
            limits.upper,
            rate.column(i).amax(),
            limits.rate,
            acceleration.column(i).amax(),
            limits.acceleration
        );
    }
    let _ = writeln!(
        text,
        "  without payload: force up to {:.3} N of {}, torque up to {:.4} N m of {}\n",
        period.largest_force(),
        args.force_limit,
        period.largest_torque(),
        args.torque_limit
    );
    let _ = writeln!(
        text,
        "predicted from {} cycle{} at {} Hz, pose noise {} m, {} rad, wrench noise {} N, {} N m:",
        args.cycles - 1,
        if args.cycles == 2 { "" } else { "s" },
        args.rate,
        args.position_noise,
        args.attitude_noise,
        args.force_noise,
        args.torque_noise
    );
    let free = format!("with {} harmonics free", bounds.free_harmonics);
    text += &report::sigma_table(&[("holding the motion exactly", &bounds.exact.std), (&free, &bounds.free.std)]);
    text += "  a robot that does not know its load adds harmonics, which then have to be found from the same data\n";
    if let Some(flight) = flight {
        let Saturation { any, by_component } = flight.execution.saturation;
        let _ = writeln!(
            text,
            "\nflight with {:.3} kg of payload: {:.3} m, {:.3} rad from the motion (root mean square)",
            flight.payload_kg, flight.tracking_rms.0, flight.tracking_rms.1
        );
        let shares: Vec<String> = ["torque x", "torque y", "torque z", "force x", "force y", "force z"]
            .into_iter()
            .zip(by_component)
            .filter(|(_, share)| *share > 0.0)
            .map(|(name, share)| format!("{name} {:.1} %", 100.0 * share))
            .collect();
        let which = if shares.is_empty() { String::new() } else { format!(" ({})", shares.join(", ")) };
        let _ = writeln!(text, "  at a limit of the actuators for {:.1} % of the time{which}", 100.0 * any);
    }
    text
}

/// A cost to some digits, however small: criteria a and e are squares of small numbers.
fn significant(cost: f64) -> String {
    if cost == 0.0 || cost.abs() >= 0.1 { format!("{cost:.4}") } else { format!("{cost:.4e}") }
}

/// What is needed to repeat the run.
fn run_record(args: &ExciteArgs) -> String {
    let hash = |path: &Option<PathBuf>| path.as_deref().and_then(|path| tumble_formats::log::hash(path).ok());
    let options: Vec<String> = std::env::args().skip(1).collect();
    serde_json::json!({
        "format": 1,
        "version": env!("CARGO_PKG_VERSION"),
        "commit": option_env!("TUMBLE_COMMIT"),
        "command": "excite",
        "configuration": options,
        "seed": args.seed,
        "input_hash": { "body": hash(&args.body), "payload": hash(&args.payload) },
    })
    .to_string()
}
