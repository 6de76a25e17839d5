//! `cargo xtask mutants`: planted source changes, each of which a test must catch.
//!
//! The changes are applied one at a time to a copy of the repository below `target/mutants`, never to the checkout; one build
//! folder serves them all, so each costs an incremental build.

use std::fmt::Display;
use std::fs;
use std::path::Path;
use std::process::{Child, ExitCode, Stdio};
use std::time::{Duration, Instant};

use crate::command::{cargo, root, target_dir};
use crate::tidy;

/// One planted change.
struct Mutant {
    name: &'static str,
    file: &'static str,
    /// Must occur exactly once in the file.
    original: &'static str,
    replacement: &'static str,
    /// The arguments of `cargo test` that must fail.
    test: &'static str,
}

/// The list grows with each issue.
const MUTANTS: &[Mutant] = &[
    Mutant {
        name: "promises: a filter that follows the state forgets nothing",
        file: "crates/planning/src/mission/stretch_settings.rs",
        original: "retained: white / innovation }",
        replacement: "retained: 1.0 }",
        test: "-p tumble-planning --lib stretch_settings",
    },
    Mutant {
        name: "promises: the adjoint of what measurements leave is left out",
        file: "crates/planning/src/local/information.rs",
        original: "                *entry *= share;",
        replacement: "                let _ = (entry, share);",
        test: "-p tumble-planning --lib shooting",
    },
    Mutant {
        name: "promises: the mass lasts as if one axis alone told it",
        file: "crates/planning/src/mission/thrust_doubt.rs",
        original: "f64::sqrt(pushed_axes.max(1) as f64)",
        replacement: "f64::sqrt(pushed_axes.min(1) as f64)",
        test: "-p tumble-planning --lib thrust_doubt",
    },
    Mutant {
        name: "missions: plans turn as fast about each axis as the localisation survives in all",
        file: "crates/tumble/src/scenario/fly.rs",
        original: "if planar { self.rate_rad_s } else { self.rate_rad_s / libm::sqrt(3.0) }",
        replacement: "if planar { self.rate_rad_s } else { self.rate_rad_s }",
        test: "-p tumble --lib fly",
    },
    Mutant {
        name: "flight estimator: a robot that answers its own noise learns a body from it",
        file: "crates/identification/src/recursive/flight_estimator/filtered.rs",
        original: "(true, false) if self.is_quiet(rules) =>",
        replacement: "(true, false) if self.is_quiet(rules) && false =>",
        test: "-p tumble-identification --lib flight_estimator",
    },
    Mutant {
        name: "first lessons: each pass about the body that the last one found, without a memory",
        file: "crates/identification/src/recursive/flight_estimator/first_lessons.rs",
        original: "step - (self.bodies + self.steps) * root.solve(&self.steps.tr_mul(step))",
        replacement: "step - (self.bodies + self.steps) * root.solve(&self.steps.tr_mul(step)) * 0.0",
        test: "-p tumble-identification --lib first_lessons",
    },
    Mutant {
        name: "flight estimator: corrections of the body that pull to one side are none of its business",
        file: "crates/identification/src/recursive/flight_estimator/body_score.rs",
        original: "self.moved += step;",
        replacement: "let _ = step;",
        test: "-p tumble-identification --lib body_score",
    },
    Mutant {
        name: "stretches: what begins in contact may go deeper",
        file: "crates/planning/src/mission/serve.rs",
        original: "if next.distance_m < here.distance_m || ",
        replacement: "if ",
        test: "-p tumble-planning --test suite retreats",
    },
    Mutant {
        name: "retreats: any place farther away will do",
        file: "crates/planning/src/mission/retreat.rs",
        original: "            if kept_m >= settings.margin_m {",
        replacement: "            if kept_m >= here_m + GAIN_M {",
        test: "-p tumble-planning --test suite retreats",
    },
    Mutant {
        name: "flight estimator: what wandered loudly goes on doing so for a filter that begins anew",
        file: "crates/identification/src/recursive/flight_estimator/filtered.rs",
        original: "        self.covariance = fresh;\n        self.louder = [1.0; 3];",
        replacement: "        self.covariance = fresh;",
        test: "-p tumble --test suite a_localisation_that_comes_back_is_followed_again",
    },
    Mutant {
        name: "identify: white errors of the velocity are no part of what positions leave",
        file: "crates/identification/src/identify/wander.rs",
        original: "2.0 / 3.0 * per_block",
        replacement: "0.0 * per_block",
        test: "-p tumble-identification --lib identify::wander",
    },
    Mutant {
        name: "MCAP: a chunk says where its messages were before they were compressed, one off",
        file: "crates/formats/src/recording/mcap_writer.rs",
        original: "let chunk_at = self.out.bytes;",
        replacement: "let chunk_at = self.out.bytes + 1;",
        test: "-p tumble-formats --test suite mcap",
    },
    Mutant {
        name: "flight estimator: begun anew, it is sure of a wrench that was in doubt",
        file: "crates/identification/src/recursive/flight_estimator/filtered.rs",
        original: "if self.wrench_is_doubtful || is_lost {\n            self.widen_motion(rules);\n        }\n        if self.wrench_is_doubtful {",
        replacement: "if is_lost {\n            self.widen_motion(rules);\n        }\n        if false {",
        test: "-p tumble-identification --lib flight_estimator",
    },
    Mutant {
        name: "TOML: an array that is longer than what is read of it passes",
        file: "crates/formats/src/toml_text.rs",
        original: "if values.len() > used.len() =>",
        replacement: "if values.len() > used.len() + 9 =>",
        test: "-p tumble-formats --lib actuator_file",
    },
    Mutant {
        name: "ways: a new one that takes longer than the whole old one is flown as it is",
        file: "crates/planning/src/mission/serve.rs",
        original: "&& first_units < settings.way_units",
        replacement: "&& first_units > settings.way_units",
        test: "-p tumble-planning --test suite new_ways",
    },
    Mutant {
        name: "increment: operands of the cross product swapped",
        file: "crates/lie/src/increment_chart.rs",
        original: "psi: (l * f_a0 + l.cross(&phi))",
        replacement: "psi: (l * f_a0 + phi.cross(&l))",
        test: "-p tumble-lie --lib",
    },
    Mutant {
        name: "increment: sign of the dual scalar",
        file: "crates/lie/src/increment_chart.rs",
        original: "-self.phi.dot(&self.psi) / self.f_a0",
        replacement: "self.phi.dot(&self.psi) / self.f_a0",
        test: "-p tumble-lie --lib",
    },
    Mutant {
        name: "increment: other cover half turned round",
        file: "crates/lie/src/increment_chart.rs",
        original: "{ (-w, -v) }",
        replacement: "{ (-w, v) }",
        test: "-p tumble-lie --lib",
    },
    Mutant {
        name: "quaternion: scalar last read as scalar first",
        file: "crates/lie/src/quaternion.rs",
        original: "    from_wxyz(w, x, y, z, tolerance)",
        replacement: "    from_wxyz(x, y, z, w, tolerance)",
        test: "-p tumble-lie --lib",
    },
    Mutant {
        name: "SE(3): translation of the exponential turned back",
        file: "crates/lie/src/se3.rs",
        original: "psi * w - phi * f_b0 + phi.cross(&psi)",
        replacement: "psi * w - phi * f_b0 + psi.cross(&phi)",
        test: "-p tumble-lie --lib",
    },
    Mutant {
        name: "rotations: left Jacobian for the right",
        file: "crates/lie/src/so3.rs",
        original: "&(phi * -j.a), phi,",
        replacement: "&(phi * j.a), phi,",
        test: "-p tumble-lie --test suite groups::",
    },
    Mutant {
        name: "wrench: lever arm of the force lost",
        file: "crates/lie/src/spatial.rs",
        original: "a_from_b.rotation * self.torque + a_from_b.translation.vector.cross(&force)",
        replacement: "a_from_b.rotation * self.torque",
        test: "-p tumble-lie --test suite groups::",
    },
    Mutant {
        name: "S(c): sign",
        file: "crates/lie/src/skew.rs",
        original: "Matrix3::new(o, -a.z, a.y, a.z, o, -a.x, -a.y, a.x, o)",
        replacement: "Matrix3::new(o, a.z, -a.y, -a.z, o, a.x, a.y, -a.x, o)",
        test: "-p tumble-dynamics --lib",
    },
    Mutant {
        name: "spatial inertia: coupling block not transposed",
        file: "crates/dynamics/src/inertia.rs",
        original: "copy_from(&-coupling)",
        replacement: "copy_from(&coupling)",
        test: "-p tumble-dynamics --lib",
    },
    Mutant {
        name: "Newton-Euler: gyroscopic torque lost",
        file: "crates/dynamics/src/free_flyer.rs",
        original: "inertia_about_origin * w_rate + w.cross(&(inertia_about_origin * w)) +",
        replacement: "inertia_about_origin * w_rate +",
        test: "-p tumble-dynamics --lib",
    },
    Mutant {
        name: "Newton-Euler: w x v missing in the twist rate",
        file: "crates/dynamics/src/free_flyer.rs",
        original: "self.acceleration_origin_body - twist_body.angular.cross(&twist_body.linear)",
        replacement: "self.acceleration_origin_body",
        test: "-p tumble-dynamics --lib",
    },
    Mutant {
        name: "pseudo-inertia: about the centre of mass, as printed",
        file: "crates/dynamics/src/inertia.rs",
        original: "(second_moment(&p.inertia_about_origin), &p.first_moment)",
        replacement: "(second_moment(&p.inertia_about_com()), &p.first_moment)",
        test: "-p tumble-dynamics --lib",
    },
    Mutant {
        name: "parallel axis: sign",
        file: "crates/dynamics/src/inertia.rs",
        original: "position.norm_squared() - position * position.transpose()",
        replacement: "position.norm_squared() + position * position.transpose()",
        test: "-p tumble-dynamics --lib",
    },
    Mutant {
        name: "packing: two entries of the inertia swapped",
        file: "crates/dynamics/src/inertia.rs",
        original: "h.z, j.m11, j.m12, j.m13, j.m22,",
        replacement: "h.z, j.m11, j.m12, j.m22, j.m13,",
        test: "-p tumble-dynamics --lib",
    },
    Mutant {
        name: "packing: the mass first in chapter 5's order",
        file: "crates/dynamics/src/parameter_vector.rs",
        original: "Self::DualQuaternion => [4, 5, 6, 7, 8, 9, 1, 2, 3, 0]",
        replacement: "Self::DualQuaternion => [0, 4, 5, 6, 7, 8, 9, 1, 2, 3]",
        test: "-p tumble-dynamics --lib",
    },
    Mutant {
        name: "variational step: root of (5.18) lost",
        file: "crates/dynamics/src/variational_free_flyer.rs",
        original: "let f_b0 = -along * per_a;",
        replacement: "let f_b0 = -along;",
        test: "-p tumble-dynamics --lib",
    },
    Mutant {
        name: "variational step: half of the impulse dropped",
        file: "crates/dynamics/src/variational_free_flyer.rs",
        original: "?.kicked(&body, &half_impulse))",
        replacement: "?.kicked(&body, &Wrench::zero()))",
        test: "-p tumble-dynamics --test suite integrators::every_integrator_has_its_order",
    },
    Mutant {
        name: "gravity: acts at the origin",
        file: "crates/dynamics/src/wrench_model.rs",
        original: "Wrench::new(self.first_moment.cross(&gravity_body), gravity_body * self.mass)",
        replacement: "Wrench::new(self.first_moment * T::zero(), gravity_body * self.mass)",
        test: "-p tumble-dynamics --test suite planted_defects_bodies::",
    },
    Mutant {
        name: "regressor: one column of the inertia",
        file: "crates/identification/src/regressors.rs",
        original: "[d.z + xy, zz - xx, d.x - yz, o, o, o]",
        replacement: "[d.z - xy, zz - xx, d.x - yz, o, o, o]",
        test: "-p tumble-identification --lib",
    },
    Mutant {
        name: "variational regressor: coupling by Phi",
        file: "crates/identification/src/regressors/variational.rs",
        original: "acceleration - (phi_f * f_b0 - phi_b * b_b0)",
        replacement: "acceleration",
        test: "-p tumble-identification --lib",
    },
    Mutant {
        name: "held wrench: weights without the triangle",
        file: "crates/identification/src/wrench_timing.rs",
        original: "wrenches[i] * (scale * (b - a) * (a + b) * 0.5 / before_s)",
        replacement: "wrenches[i] * (scale * (b - a) * 0.5)",
        test: "-p tumble-identification --lib",
    },
    Mutant {
        name: "triangular update: sign",
        file: "crates/identification/src/householder.rs",
        original: "*h -= c * s;",
        replacement: "*h += c * s;",
        test: "-p tumble-identification --lib",
    },
    Mutant {
        name: "weighted least squares: covariance not scaled",
        file: "crates/identification/src/weighted_least_squares.rs",
        original: "let covariance = inverse * spread * inverse.transpose();",
        replacement: "let covariance = inverse;",
        test: "-p tumble-identification --test suite identify_properties::covariance_is_honest",
    },
    Mutant {
        name: "interior point: gap tolerance ignored",
        file: "crates/identification/src/consistency/interior_point.rs",
        original: "if duality_gap <= tolerance {",
        replacement: "if duality_gap <= 1.0 {",
        test: "-p tumble-identification --test suite estimation_laws::",
    },
    Mutant {
        name: "links: one body's cone ignored",
        file: "crates/identification/src/multibody/consistent_links.rs",
        original: "self.margins(scaled).into_iter().all(",
        replacement: "self.margins(scaled).into_iter().skip(1).all(",
        test: "-p tumble-identification --lib multibody",
    },
    Mutant {
        name: "links: prior weighs as much as the data",
        file: "crates/identification/src/multibody/consistent_links.rs",
        original: "let weight = self.prior_weight.sqrt();",
        replacement: "let weight = self.prior_weight.sqrt().max(1.0);",
        test: "-p tumble-identification --lib multibody",
    },
    Mutant {
        name: "links: prior's correlations with what the data determine lost",
        file: "crates/identification/src/multibody/consistent_links.rs",
        original: "let mut rows = weighted.transpose() * precision;",
        replacement: "let mut rows = weighted.transpose();",
        test: "-p tumble-identification --lib multibody",
    },
    Mutant {
        name: "base parameters: rounding taken for excitement",
        file: "crates/identification/src/multibody/base_parameters.rs",
        original: "|values| tolerance * values.max()",
        replacement: "|values| tolerance * 1e-9 * values.max()",
        test: "-p tumble-identification --lib multibody",
    },
    Mutant {
        name: "base parameters: sign of what hides behind another",
        file: "crates/identification/src/multibody/base_parameters.rs",
        original: "functional[k] = -direction[j];",
        replacement: "functional[k] = direction[j];",
        test: "-p tumble-identification --lib multibody",
    },
    Mutant {
        name: "cone: sign of the products of inertia",
        file: "crates/identification/src/consistency/pseudo_inertia_cone.rs",
        original: "            -p[(1, 2)],",
        replacement: "            p[(1, 2)],",
        test: "-p tumble-identification --lib",
    },
    Mutant {
        name: "wheel: gyroscopic term lost",
        file: "crates/identification/src/wheel/regressors.rs",
        original: "-(Vector3::z() * wheel_acceleration + rate_body.cross(&(Vector3::z() * wheel_speed)))",
        replacement: "-(Vector3::z() * wheel_acceleration + rate_body * (T::zero() * wheel_speed))",
        test: "-p tumble-identification --test suite wheel_throws::",
    },
    Mutant {
        name: "wheel: parallel axis of two bodies",
        file: "crates/identification/src/wheel/regressors.rs",
        original: "offset.norm_squared() - offset * offset.transpose()",
        replacement: "offset.norm_squared() + offset * offset.transpose()",
        test: "-p tumble-identification --test suite wheel_throws::",
    },
    Mutant {
        name: "wheel: a throw identified as its sensors read",
        file: "crates/identification/src/wheel/momentum_balance.rs",
        original: "Self::from_throw(&record.corrected(errors), settings)",
        replacement: "Self::from_throw(record, settings)",
        test: "-p tumble-identification --test suite wheel_throws::",
    },
    Mutant {
        name: "wheel: telemetry corrected the wrong way",
        file: "crates/identification/src/wheel/sensor_errors.rs",
        original: "wheel_speed(sample.time_s + errors.wheel_delay_s)",
        replacement: "wheel_speed(sample.time_s - errors.wheel_delay_s)",
        test: "-p tumble-identification --test suite wheel_throws::",
    },
    Mutant {
        name: "wheel: the gyro's axes bent the wrong way",
        file: "crates/identification/src/wheel/sensor_errors.rs",
        original: "Matrix3::new(x, xy, xz, 0.0, y, yz, 0.0, 0.0, z)",
        replacement: "Matrix3::new(x, -xy, -xz, 0.0, y, -yz, 0.0, 0.0, z)",
        test: "-p tumble-identification --test suite wheel_throws::",
    },
    Mutant {
        name: "wheel: tilted the wrong way",
        file: "crates/identification/src/wheel/sensor_errors.rs",
        original: "Vector3::new(tilt_y, -tilt_x, 0.0)",
        replacement: "Vector3::new(-tilt_y, tilt_x, 0.0)",
        test: "-p tumble-identification --test suite wheel_throws::",
    },
    Mutant {
        name: "wheel: how uncertain the sensors are forgotten",
        file: "crates/identification/src/wheel/throw.rs",
        original: "quantity(reading) - quantity(nominal)",
        replacement: "quantity(reading) - quantity(reading)",
        test: "-p tumble-identification --test suite wheel_throws::",
    },
    Mutant {
        name: "state space: direct path of the inputs lost",
        file: "crates/identification/src/state_space/augmented_filter.rs",
        original: "-(row * self.columns + direct)",
        replacement: "-(row * self.columns + direct * 0.0)",
        test: "-p tumble-identification --test suite state_space::",
    },
    Mutant {
        name: "likelihood: sign of the velocity's tangent by the rate",
        file: "crates/identification/src/likelihood/segment.rs",
        original: "velocity_by_rate: swept * (-h / 2.0)",
        replacement: "velocity_by_rate: swept * (h / 2.0)",
        test: "-p tumble-identification --lib likelihood::",
    },
    Mutant {
        name: "likelihood: pull of the noise prior forgotten",
        file: "crates/identification/src/likelihood/elimination.rs",
        original: "self.stage[NOISE + i][last] += precision * noise;",
        replacement: "self.stage[NOISE + i][last] += 0.0 * noise;",
        test: "-p tumble-identification --lib likelihood::",
    },
    Mutant {
        name: "likelihood: inputs shifted against the delay",
        file: "crates/identification/src/likelihood/drive.rs",
        original: "let start_s = sample.time_s - shift_s;",
        replacement: "let start_s = sample.time_s + shift_s;",
        test: "-p tumble-identification --test suite calibration::delays_of_many_samples",
    },
    Mutant {
        name: "likelihood: arrival cost left where the state was",
        file: "crates/identification/src/likelihood/chain.rs",
        original: "recenter(&mut self.arrival, &first, step.moved.as_slice());",
        replacement: "recenter(&mut self.arrival, &[0.0; 12], step.moved.as_slice());",
        test: "-p tumble-identification --test suite fixed_lag::close_to_the_batch",
    },
    Mutant {
        name: "state space: likelihood at the unknowns' best, not over them",
        file: "crates/identification/src/state_space/augmented_filter.rs",
        original: "self.log_determinant + log_information + squared_innovations",
        replacement: "self.log_determinant + log_information * 0.0 + squared_innovations",
        test: "-p tumble-identification --test suite state_space::",
    },
    Mutant {
        name: "state space: delay and lag taken as known",
        file: "crates/identification/src/state_space/likelihood_maximum.rs",
        original: "&best.covariance + &slope * &inverse * slope.transpose()",
        replacement: "&best.covariance + &slope * &inverse * slope.transpose() * 0.0",
        test: "-p tumble-identification --test suite state_space::",
    },
    Mutant {
        name: "state space: a lagged command held over the step",
        file: "crates/identification/src/state_space/signal.rs",
        original: "commands[0] * (mean_kept - kept) + commands[1] * (1.0 - mean_kept)",
        replacement: "commands[0] * (1.0 - kept)",
        test: "-p tumble-identification --test suite state_space::",
    },
    Mutant {
        name: "log: quaternion read scalar first",
        file: "crates/formats/src/log/row.rs",
        original: "from_xyzw(x, y, z, w, QUATERNION_NORM_TOLERANCE)",
        replacement: "from_xyzw(y, z, w, x, QUATERNION_NORM_TOLERANCE)",
        test: "-p tumble-formats --lib log",
    },
    Mutant {
        name: "log: time through a float",
        file: "crates/formats/src/log.rs",
        original: "    i64::try_from(if negative { -value } else { value }).ok()",
        replacement: "    Some((text.parse::<f64>().ok()? * 1e9).round() as i64)",
        test: "-p tumble-formats --lib log",
    },
    Mutant {
        name: "recursive update: noise of the row left out of the innovation covariance",
        file: "crates/identification/src/recursive/belief.rs",
        original: "remaining[i][i] += deviations[i] * deviations[i];",
        replacement: "remaining[i][i] += deviations[i];",
        test: "-p tumble-identification --test suite recursive_laws::",
    },
    Mutant {
        name: "gate: never lets go of a wrong belief",
        file: "crates/identification/src/recursive/chi_square_gate.rs",
        original: "self.rejections_in_a_row < self.patience",
        replacement: "self.rejections_in_a_row < self.patience || nis > threshold",
        test: "-p tumble-identification --test suite recursive_laws::",
    },
    Mutant {
        name: "gate: threshold of one degree of freedom more",
        file: "crates/identification/src/recursive/chi_square_gate.rs",
        original: "chi_square_quantile(probability, i + 1)",
        replacement: "chi_square_quantile(probability, i + 2)",
        test: "-p tumble-identification --test suite recursive_laws::",
    },
    Mutant {
        name: "recursive SDP: reports before it has solved",
        file: "crates/identification/src/recursive/sdp.rs",
        original: "self.estimate = self.solver.solve(filter.information())?;",
        replacement: "self.estimate = self.solver.solve(self.filter.information())?;",
        test: "-p tumble-identification --test suite recursive_laws::",
    },
    Mutant {
        name: "joint motion: w x v twice in the sensitivity of the accelerometer",
        file: "crates/identification/src/recursive/joint_motion.rs",
        original: "lower += skew(v);",
        replacement: "lower -= skew(v);",
        test: "-p tumble-identification --lib recursive",
    },
    Mutant {
        name: "change detection: evidence with the sign turned",
        file: "crates/identification/src/recursive/change_detection.rs",
        original: "candidate.evidence += then - now;",
        replacement: "candidate.evidence += now - then;",
        test: "-p tumble-identification --test suite recursive_changes::",
    },
    Mutant {
        name: "time ordering: the newest leaves first",
        file: "crates/identification/src/synchronize/ordering.rs",
        original: "(Some(Some(a)), Some(Some(b))) => a.key() < b.key(),",
        replacement: "(Some(Some(a)), Some(Some(b))) => a.key() > b.key(),",
        test: "-p tumble-identification --lib synchronize::ordering",
    },
    Mutant {
        name: "time ordering: a late sample is let go",
        file: "crates/identification/src/synchronize/ordering.rs",
        original: "        Some(self.release(entry))\n    }\n\n    /// Hands out",
        replacement: "        Some(self.release(entry)).filter(|released| released.in_order)\n    }\n\n    /// Hands out",
        test: "-p tumble-identification --lib synchronize::ordering",
    },
    Mutant {
        name: "delay: half step of a held wrench on the wrong side",
        file: "crates/identification/src/synchronize/delay.rs",
        original: "k - offset - delay,",
        replacement: "k + offset - delay,",
        test: "-p tumble-identification --lib synchronize::delay",
    },
    Mutant {
        name: "Savitzky-Golay: the pose is not fitted again about itself",
        file: "crates/identification/src/savitzky_golay.rs",
        original: "let [rest, rate, rate_derivative] = fit_about(&centre, window);",
        replacement: "let [rest, rate, rate_derivative] = fit_about(&(centre * centre), window);",
        test: "-p tumble-identification --lib savitzky_golay",
    },
    Mutant {
        name: "Ljung-Box: the correction for distance lost",
        file: "crates/identification/src/statistics.rs",
        original: "n * (n + 2.0) * rho * rho / (n - (k + 1) as f64)",
        replacement: "n * (n + 2.0) * rho * rho / n",
        test: "-p tumble-identification --lib statistics",
    },
    Mutant {
        name: "total least squares: noise of the columns forgotten",
        file: "crates/identification/src/comparison/total_least_squares.rs",
        original: "entry / noise[j]",
        replacement: "entry / noise[j].max(1.0).min(1.0)",
        test: "-p tumble-identification --lib comparison",
    },
    Mutant {
        name: "excitation: pushes are never advised",
        file: "crates/identification/src/excitation/diagnosis.rs",
        original: "pushes.into_iter().chain(turns).chain(both)",
        replacement: "turns.into_iter().chain(turns).chain(both).take(pushes.len() * 2)",
        test: "-p tumble-identification --lib excitation",
    },
    Mutant {
        name: "Fourier: Euler yaw axis turned the wrong way by roll",
        file: "crates/identification/src/fourier/attitude.rs",
        original: "Vector3::new(-cp * p1, cc * r1 - ss * p1, -cs * r1 - sc * p1)",
        replacement: "Vector3::new(-cp * p1, cc * r1 - ss * p1, cs * r1 - sc * p1)",
        test: "-p tumble-identification --lib fourier::",
    },
    Mutant {
        name: "Fourier: length of the quaternion taken as constant",
        file: "crates/identification/src/fourier/attitude.rs",
        original: "l1 * inverse + l0 * inverse_first,",
        replacement: "l1 * inverse,",
        test: "-p tumble-identification --lib fourier::",
    },
    Mutant {
        name: "Fourier: turning frame lost in the sensitivity",
        file: "crates/identification/src/fourier/motion.rs",
        original: "copy_from(&(first * 2.0 + w * map))",
        replacement: "copy_from(&(first * 2.0))",
        test: "-p tumble-identification --lib fourier::",
    },
    Mutant {
        name: "Fourier: sensitivity of the acceleration by attitude, sign",
        file: "crates/identification/src/fourier/motion.rs",
        original: "copy_from(&(skew(&self.acceleration_origin_body()) * map))",
        replacement: "copy_from(&-(skew(&self.acceleration_origin_body()) * map))",
        test: "-p tumble-identification --lib fourier::",
    },
    Mutant {
        name: "extremes: nothing looked for between samples",
        file: "crates/identification/src/fourier/extremes.rs",
        original: "best + last_gap - gap(length_s)",
        replacement: "best + last_gap",
        test: "-p tumble-identification --lib fourier::",
    },
    Mutant {
        name: "extremes: sines and cosines exchanged",
        file: "crates/identification/src/fourier/extremes.rs",
        original: "Complex::new(-column[n + k], -column[k])",
        replacement: "Complex::new(-column[k], -column[n + k])",
        test: "-p tumble-identification --lib fourier::",
    },
    Mutant {
        name: "extremes: bend of the turning body a hundredth",
        file: "crates/identification/src/fourier/extremes.rs",
        original: "let turning = w3 + centripetal;",
        replacement: "let turning = 0.01 * w3;",
        test: "-p tumble-identification --lib fourier::",
    },
    Mutant {
        name: "criterion: gradient of A by the covariance, not its square",
        file: "crates/identification/src/criteria.rs",
        original: "|value| -1.0 / (value * value)",
        replacement: "|value| -1.0 / value",
        test: "-p tumble-identification --test suite custom_criterion::",
    },
    Mutant {
        name: "criterion: gradient of the condition number by the worst only",
        file: "crates/identification/src/criteria.rs",
        original: "best * best.transpose() - worst * worst.transpose() * cost",
        replacement: "-worst * worst.transpose() * cost",
        test: "-p tumble-identification --test suite custom_criterion::",
    },
    Mutant {
        name: "criterion: lengths of the columns taken as constant",
        file: "crates/identification/src/excitation/criterion.rs",
        original: "by_normalized.component_mul(&scale) - SMatrix::from_diagonal(&by_length.component_div(&squares))",
        replacement: "by_normalized.component_mul(&scale)",
        test: "-p tumble-identification --test suite custom_criterion::",
    },
    Mutant {
        name: "coefficient likelihood: gravity forgotten in the motion",
        file: "crates/identification/src/harmonics/joint_information.rs",
        original: "instant.acceleration_origin_world -= self.gravity;",
        replacement: "instant.acceleration_origin_world -= self.gravity * 0.0;",
        test: "-p tumble-identification --test suite periodic_likelihood::",
    },
    Mutant {
        name: "coefficient likelihood: wrenches taken at the times of the poses",
        file: "crates/identification/src/harmonics/periodic_record.rs",
        original: "time_s + self.wrench_offset_s",
        replacement: "time_s + 0.0 * self.wrench_offset_s",
        test: "-p tumble-identification --test suite periodic_likelihood::",
    },
    Mutant {
        name: "coefficient likelihood: noise taken for excitation",
        file: "crates/identification/src/harmonics/likelihood.rs",
        original: "const LARGEST_NOISE_SHARE: f64 = 0.1;",
        replacement: "const LARGEST_NOISE_SHARE: f64 = 10.0;",
        test: "-p tumble-identification --test suite periodic_likelihood::",
    },
    Mutant {
        name: "Cramer-Rao bound: cycles do not average",
        file: "crates/identification/src/harmonics/cramer_rao.rs",
        original: "(std / stated[0].sqrt())",
        replacement: "(std)",
        test: "-p tumble-identification --test suite periodic_likelihood::",
    },
    Mutant {
        name: "MCAP: check sum of a chunk not looked at",
        file: "crates/formats/src/recording/mcap_reader.rs",
        original: "chunk.crc != crc32fast::hash(records)",
        replacement: "false",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP: limit of what is decompressed lost",
        file: "crates/formats/src/recording/mcap_reader.rs",
        original: "if self.expanded_length > MOST_RECORD_BYTES {",
        replacement: "if false {",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP: decompression beyond what is stated",
        file: "crates/formats/src/recording/mcap_reader.rs",
        original: "let most = self.expanded_length + 1;",
        replacement: "let most = u64::MAX;",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP: window of zstd unlimited",
        file: "crates/formats/src/recording/mcap_reader.rs",
        original: "decoder.set_max_window_size(most.max(LEAST_ZSTD_WINDOW_BYTES));",
        replacement: "decoder.set_max_window_size(u64::MAX);",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP: length of a record believed",
        file: "crates/formats/src/recording/mcap_reader.rs",
        original: "if !is_read || length > MOST_RECORD_BYTES {",
        replacement: "if !is_read {",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP: check sum of the file not looked at",
        file: "crates/formats/src/recording/mcap_reader.rs",
        original: "crc != 0 && crc != crc_before",
        replacement: "false",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP: the file's own count not looked at",
        file: "crates/formats/src/recording/mcap_reader.rs",
        original: "Fields(&body).u64() != Some(self.report.messages)",
        replacement: "false",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP: a torn chunk thrown away",
        file: "crates/formats/src/recording/mcap_reader.rs",
        original: "if !has_all && complete {",
        replacement: "if !has_all {",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP: type of ROS 2 left as it is",
        file: "crates/formats/src/recording/mcap_reader.rs",
        original: "name.replace(\"/msg/\", \"/\")",
        replacement: "name.to_owned()",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP: chunks without end",
        file: "crates/formats/src/recording/mcap_writer.rs",
        original: "time.abs_diff(first) >= LONGEST_CHUNK_NS.unsigned_abs()",
        replacement: "false",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP log: torque and force swapped",
        file: "crates/formats/src/recording/mcap_log.rs",
        original: "Wrench::new(Vector3::new(x, y, z), force.into())",
        replacement: "Wrench::new(force.into(), Vector3::new(x, y, z))",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP log: rates of another row",
        file: "crates/formats/src/recording/mcap_log.rs",
        original: "let same_row = beside.time_ns == message.log_time_ns;",
        replacement: "let same_row = beside.time_ns != message.log_time_ns;",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "MCAP log: rows joined across times",
        file: "crates/formats/src/recording/mcap_log.rs",
        original: "self.time_ns.is_some_and(|current| current != time_ns)",
        replacement: "false",
        test: "-p tumble --test suite convert_command::",
    },
    Mutant {
        name: "foxglove: ellipsoid drawn at half its size",
        file: "crates/formats/src/recording/foxglove.rs",
        original: "&(obstacle.semi_axes * 2.0)",
        replacement: "&obstacle.semi_axes",
        test: "-p tumble-formats --test suite mcap::",
    },
    Mutant {
        name: "TUM: sign of early times lost",
        file: "crates/formats/src/recording/rows.rs",
        original: "if time_ns < 0 { \"-\" } else { \"\" }",
        replacement: "\"\"",
        test: "-p tumble --test suite convert_command::",
    },
    Mutant {
        name: "propulsion: reaction torque of the impellers turned round",
        file: "crates/astrobee/src/propulsion/plant.rs",
        original: "let reaction = axis * -impeller.torque_n_m();",
        replacement: "let reaction = axis * impeller.torque_n_m();",
        test: "-p tumble-astrobee --test suite propulsion_plant::",
    },
    Mutant {
        name: "propulsion: impellers turn the same way",
        file: "crates/astrobee/src/propulsion/plant.rs",
        original: "const IMPELLER_AXES_Y: [f64; 2] = [1.0, -1.0];",
        replacement: "const IMPELLER_AXES_Y: [f64; 2] = [1.0, 1.0];",
        test: "-p tumble-astrobee --test suite propulsion_plant::",
    },
    Mutant {
        name: "propulsion: physical sign of the gyroscopic torque",
        file: "crates/astrobee/src/propulsion/plant.rs",
        original: "GyroscopicSign::Physical => reaction - coupling,",
        replacement: "GyroscopicSign::Physical => reaction + coupling,",
        test: "-p tumble-astrobee --test suite propulsion_plant::",
    },
    Mutant {
        name: "propulsion: leak areas of the modules swapped",
        file: "crates/astrobee/src/propulsion/constants.rs",
        original: "pub const LEAK_AREAS_M2: [f64; 2] = [0.004_466_7, 0.004_227_3];",
        replacement: "pub const LEAK_AREAS_M2: [f64; 2] = [0.004_227_3, 0.004_466_7];",
        test: "-p tumble-astrobee --test suite propulsion_plant::",
    },
    Mutant {
        name: "propulsion: a module's nozzles taken by the other",
        file: "crates/astrobee/src/propulsion/plant.rs",
        original: "let mut thrusts_n = joined(flows.map(|flow| flow.thrusts_n));",
        replacement: "let [starboard, port] = flows.map(|flow| flow.thrusts_n); let mut thrusts_n = joined([port, starboard]);",
        test: "-p tumble-astrobee --test suite propulsion_plant::",
    },
    Mutant {
        name: "flights: servos do not wait for a late command",
        file: "crates/astrobee/src/propulsion/replay.rs",
        original: "running.stepped_ns.saturating_add(PERIOD_NS + PERIOD_NS / 2)",
        replacement: "running.stepped_ns.saturating_add(PERIOD_NS)",
        test: "-p tumble-astrobee --lib replay",
    },
    Mutant {
        name: "servo: play after the shaft has moved",
        file: "crates/astrobee/src/propulsion/servo.rs",
        original: "        self.flap_rad()\n    }",
        replacement: "        self.geared_rad = self.geared_rad.clamp(self.shaft_rad - HALF_BACKLASH_RAD, self.shaft_rad + HALF_BACKLASH_RAD);\n        self.flap_rad()\n    }",
        test: "-p tumble-astrobee --lib",
    },
    Mutant {
        name: "servo: no play",
        file: "crates/astrobee/src/propulsion/servo.rs",
        original: "const HALF_BACKLASH_RAD: f64 = 0.5 *",
        replacement: "const HALF_BACKLASH_RAD: f64 = 0.0 *",
        test: "-p tumble-astrobee --test suite propulsion_plant::",
    },
    Mutant {
        name: "servo: stops stop the rate",
        file: "crates/astrobee/src/propulsion/servo.rs",
        original: "self.shaft_rate_rad_s += CONTROL_PERIOD_S / INERTIA_KG_M2 * torque;",
        replacement: "self.shaft_rate_rad_s = if self.shaft_rad <= 0.0 { 0.0 } else { self.shaft_rate_rad_s + CONTROL_PERIOD_S / INERTIA_KG_M2 * torque };",
        test: "-p tumble-astrobee --test suite propulsion_plant::",
    },
    Mutant {
        name: "motors: high-pass of the controller forgotten",
        file: "crates/astrobee/src/propulsion/pid.rs",
        original: "self.high_pass += CONTROL_PERIOD_S * derivative;",
        replacement: "",
        test: "-p tumble-astrobee --test suite propulsion_plant::",
    },
    Mutant {
        name: "impeller: supply does not limit the voltage",
        file: "crates/astrobee/src/propulsion/impeller.rs",
        original: ".min(supply_v).max(-supply_v)",
        replacement: "",
        test: "-p tumble-astrobee --lib",
    },
    Mutant {
        name: "driver: trims from one end only",
        file: "crates/astrobee/src/propulsion/driver.rs",
        original: ".saturating_sub(u16::from(low)).saturating_sub(u16::from(high))",
        replacement: ".saturating_sub(u16::from(high))",
        test: "-p tumble-astrobee --lib",
    },
    Mutant {
        name: "flown controller: velocity error in full",
        file: "crates/astrobee/src/flight_controller.rs",
        original: "pub const VELOCITY_GAIN: f64 = 0.5;",
        replacement: "pub const VELOCITY_GAIN: f64 = 1.0;",
        test: "-p tumble-astrobee --lib",
    },
    Mutant {
        name: "flown controller: gyroscopic torque turned round",
        file: "crates/astrobee/src/flight_controller.rs",
        original: "let gyroscopic = estimate.rate_body.cross(&(inertia * estimate.rate_body));",
        replacement: "let gyroscopic = (inertia * estimate.rate_body).cross(&estimate.rate_body);",
        test: "-p tumble-astrobee --lib",
    },
    Mutant {
        name: "flown controller: coning term turned round",
        file: "crates/astrobee/src/flight_controller.rs",
        original: "omega.cross(alpha) * (dt * dt * dt / 24.0)",
        replacement: "alpha.cross(omega) * (dt * dt * dt / 24.0)",
        test: "-p tumble-astrobee --lib",
    },
    Mutant {
        name: "flown controller: integrals kept while stopping",
        file: "crates/astrobee/src/flight_controller.rs",
        original: "self.0 = if engaged { self.0 + input * CONTROL_PERIOD_S } else { Vector3::zeros() };",
        replacement: "self.0 = if engaged { self.0 + input * CONTROL_PERIOD_S } else { self.0 };",
        test: "-p tumble-astrobee --lib",
    },
    Mutant {
        name: "flown controller: torque stays at the centre of mass",
        file: "crates/astrobee/src/flight_controller.rs",
        original: "Wrench::new(torque + center_of_mass_body.cross(&force), force)",
        replacement: "Wrench::new(torque - center_of_mass_body.cross(&force), force)",
        test: "-p tumble-astrobee --lib",
    },
    Mutant {
        name: "propulsion: thrust along the outflow",
        file: "crates/astrobee/src/propulsion/nozzle.rs",
        original: "py * ox - px * oy, -ox, -oy, -oz]",
        replacement: "py * ox - px * oy, ox, oy, oz]",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "propulsion: a nozzle dropped from the sum",
        file: "crates/astrobee/src/propulsion/nozzle.rs",
        original: "wrench_per_thrust.iter().zip(thrusts_n)",
        replacement: "wrench_per_thrust.iter().zip(thrusts_n).skip(1)",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "propulsion: one discharge coefficient for two",
        file: "crates/astrobee/src/propulsion/nozzle.rs",
        original: "2.0 * (self.discharge_coefficient * self.discharge_coefficient) * pressure_pa * area_m2",
        replacement: "2.0 * self.discharge_coefficient * pressure_pa * area_m2",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "propulsion: both modules leak alike",
        file: "crates/astrobee/src/propulsion/nozzle.rs",
        original: "Self::Port => port,",
        replacement: "Self::Port => starboard,",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "propulsion: positivity shift upside down",
        file: "crates/astrobee/src/propulsion/nozzle.rs",
        original: ".fold(0.0, f64::min)",
        replacement: ".fold(0.0, f64::max)",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "propulsion: the allocation believes the other leak area",
        file: "crates/astrobee/src/propulsion/blower.rs",
        original: "f64 = LEAK_AREAS_M2[0]",
        replacement: "f64 = LEAK_AREAS_M2[1]",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "recordings: CDR aligned to its header's start",
        file: "crates/formats/src/recording/wire.rs",
        original: "self.at.wrapping_sub(ENCAPSULATION_BYTES) % N",
        replacement: "self.at % N",
        test: "-p tumble-formats --test suite recordings::",
    },
    Mutant {
        name: "recordings: CDR byte order turned round",
        file: "crates/formats/src/recording/wire.rs",
        original: "wire.big_endian = kind == 0;",
        replacement: "wire.big_endian = kind == 1;",
        test: "-p tumble-formats --test suite recordings::",
    },
    Mutant {
        name: "recordings: rest of a message not missed",
        file: "crates/formats/src/recording/wire.rs",
        original: "if left > padding {",
        replacement: "if left > padding + 1000 {",
        test: "-p tumble-formats --test suite recordings::",
    },
    Mutant {
        name: "bags: chunk decompressed without bound",
        file: "crates/formats/src/recording/bag.rs",
        original: "bzip2::read::BzDecoder::new(data).take(declared + 1)",
        replacement: "bzip2::read::BzDecoder::new(data).take(declared.max(1 << 40))",
        test: "-p tumble-formats --test suite recordings::",
    },
    Mutant {
        name: "bags: size of a chunk believed",
        file: "crates/formats/src/recording/bag.rs",
        original: "Ok(_) if content.len() as u64 != declared =>",
        replacement: "Ok(_) if content.len() as u64 > declared + (1 << 40) =>",
        test: "-p tumble-formats --test suite recordings::",
    },
    Mutant {
        name: "bags: torn chunk thrown away",
        file: "crates/formats/src/recording/bag.rs",
        original: "                    scan.torn_chunk(offset, &fields, &data, &mut content);",
        replacement: "                    let _ = fields;",
        test: "-p tumble-formats --test suite recordings::",
    },
    Mutant {
        name: "messages: any definition read",
        file: "crates/formats/src/recording/messages.rs",
        original: "if told && !known.contains(&raw.md5) {",
        replacement: "if told && known.is_empty() {",
        test: "-p tumble-formats --test suite recordings::",
    },
    Mutant {
        name: "messages: oldest flight mode read as the middle one",
        file: "crates/formats/src/recording/messages.rs",
        original: "raw.md5 == oldest || raw.md5 == older, raw.md5 != oldest)",
        replacement: "raw.md5 == oldest || raw.md5 == older, true)",
        test: "-p tumble-formats --test suite recordings::",
    },
    Mutant {
        name: "flights: lost states believed",
        file: "crates/formats/src/recording/flight.rs",
        original: "if state.confidence == CONFIDENCE_LOST ||",
        replacement: "if state.confidence == u8::MAX ||",
        test: "-p tumble --test suite identify_recordings::",
    },
    Mutant {
        name: "flights: commanded torque left about the centre of mass",
        file: "crates/formats/src/recording/flight.rs",
        original: "wrench.torque + self.center_of_mass.cross(&wrench.force)",
        replacement: "wrench.torque",
        test: "-p tumble --test suite identify_recordings::",
    },
    Mutant {
        name: "flights: a command holds for ever",
        file: "crates/formats/src/recording/flight.rs",
        original: "time_ns.saturating_add(LONGEST_HOLD_NS)",
        replacement: "i64::MAX",
        test: "-p tumble --test suite identify_recordings::",
    },
    Mutant {
        name: "flights: the last command of an interval taken for all of it",
        file: "crates/formats/src/recording/flight.rs",
        original: "let step = step_ns as f64;",
        replacement: "let step = if step_ns < 6_000_000 { 0.0 } else { step_ns as f64 };",
        test: "-p tumble --test suite identify_recordings::",
    },
    Mutant {
        name: "flights: silent telemetry believed",
        file: "crates/formats/src/recording/flight.rs",
        original: "self.speeds.is_some() || speeds.iter().any(|speed| *speed > 0)",
        replacement: "true",
        test: "-p tumble --test suite identify_recordings::",
    },
    Mutant {
        name: "propulsion: table of pressure cut at the largest thrust",
        file: "crates/astrobee/src/propulsion/inverse.rs",
        original: "AreaTable::Full => effective_area_m2,",
        replacement: "AreaTable::Full => effective_area_m2.min(AREA_AT_LARGEST_THRUST_M2),",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "propulsion: closed flaps believed to leak",
        file: "crates/astrobee/src/propulsion/inverse.rs",
        original: "self.belief == Belief::Allocation;",
        replacement: "self.belief == Belief::Hardware;",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "propulsion: bytes rounded",
        file: "crates/astrobee/src/propulsion/allocation.rs",
        original: "counts as u8",
        replacement: "counts.round() as u8",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "propulsion: lever of the centre of mass reversed",
        file: "crates/astrobee/src/propulsion/allocation.rs",
        original: "torque + self.center_of_mass_body.cross(&force)",
        replacement: "torque - self.center_of_mass_body.cross(&force)",
        test: "-p tumble-astrobee --test suite propulsion::",
    },
    Mutant {
        name: "allocate: realised torque about the wrong point",
        file: "crates/tumble/src/cli/allocate.rs",
        original: "allocation.about_center_of_mass(&realized)",
        replacement: "allocation.about_origin(&realized)",
        test: "-p tumble --test suite allocate_command::",
    },
    Mutant {
        name: "sensing: notch of another impeller mode",
        file: "crates/astrobee/src/sensing/flight_filter.rs",
        original: "Some((31.440_180_95, 1.208_223_739_5))",
        replacement: "Some((31.440_180_95, 1.999_637_218_2))",
        test: "-p tumble-astrobee --lib sensing",
    },
    Mutant {
        name: "sensing: taps of the accelerometer's notch swapped",
        file: "crates/astrobee/src/sensing/flight_filter.rs",
        original: "(u1 + u4) * second + (u2 + u3) * third",
        replacement: "(u1 + u4) * third + (u2 + u3) * second",
        test: "-p tumble-astrobee --lib sensing",
    },
    Mutant {
        name: "sensing: filters start at zero",
        file: "crates/astrobee/src/sensing/flight_filter.rs",
        original: "([input; 5], [input; 3], true)",
        replacement: "([input; 5], [input * 0.0; 3], true)",
        test: "-p tumble-astrobee --lib sensing",
    },
    Mutant {
        name: "sensing: centripetal acceleration added instead of removed",
        file: "crates/astrobee/src/sensing/imu.rs",
        original: "gravity_body - rate.cross(&rate.cross(&self.lever_arm_body))",
        replacement: "gravity_body + rate.cross(&rate.cross(&self.lever_arm_body))",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: lever arm of the angular acceleration turned round",
        file: "crates/astrobee/src/sensing/imu.rs",
        original: "truth.angular_acceleration_body.cross(&r)",
        replacement: "r.cross(&truth.angular_acceleration_body)",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: gravity felt upwards",
        file: "crates/astrobee/src/sensing/imu.rs",
        original: "turning - gravity_body",
        replacement: "turning + gravity_body",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: average one tap older",
        file: "crates/astrobee/src/sensing/imu.rs",
        original: "f64::from(tap) / (INTERNAL_RATE_HZ * step_s)",
        replacement: "f64::from(tap + 1) / (INTERNAL_RATE_HZ * step_s)",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: noise density taken as two-sided",
        file: "crates/astrobee/src/sensing/imu.rs",
        original: "libm::sqrt(0.5 / step_s)",
        replacement: "libm::sqrt(1.0 / step_s)",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: sources share streams",
        file: "crates/astrobee/src/sensing/streams.rs",
        original: "spread(seed) ^ (source as u64)",
        replacement: "spread(seed) ^ (source as u64 & 1)",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: latency dropped",
        file: "crates/astrobee/src/sensing/localization.rs",
        original: "self.latency_ns + extra_ns(&mut self.arrivals,",
        replacement: "0 * self.latency_ns + extra_ns(&mut self.arrivals,",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "feedback: motion taken for noise",
        file: "crates/identification/src/identify/feedback.rs",
        original: "(of(Reach::Before) - of(Reach::After)).max(0.0)",
        replacement: "of(Reach::Before).max(0.0)",
        test: "-p tumble-identification --lib identify::feedback::",
    },
    Mutant {
        name: "coherent: gains of the wrench forgotten",
        file: "crates/identification/src/likelihood/flight/coherent.rs",
        original: "from if wrench[from / 3] > 0.0 => errors[to / 3] / wrench[from / 3],",
        replacement: "from if wrench[from / 3] > 0.0 => 0.0 * errors[to / 3],",
        test: "-p tumble-identification --lib likelihood::flight::tests::thrusters_that_nobody",
    },
    Mutant {
        name: "weak form: poses that are worse than the table believed",
        file: "crates/identification/src/likelihood/flight/weak_form.rs",
        original: "all(|(longer, here)| *longer > here)",
        replacement: "all(|(longer, here)| *longer > 0.0 * here)",
        test: "-p tumble-identification --lib weak_form::",
    },
    Mutant {
        name: "weak form: the sign of the sag",
        file: "crates/identification/src/likelihood/flight/thrusters.rs",
        original: "self.wrenches(|sample| -further[sample])",
        replacement: "self.wrenches(|sample| further[sample])",
        test: "-p tumble-identification --lib weak_form::",
    },
    Mutant {
        name: "actuators: the delay of commands ignored",
        file: "crates/identification/src/actuators.rs",
        original: "next + self.delay_s <= at",
        replacement: "*next <= at",
        test: "-p tumble-identification --lib actuators::",
    },
    Mutant {
        name: "stages: the body after a change has no say in its place",
        file: "crates/identification/src/likelihood/flight/stages.rs",
        original: "of_before.cost(0..j) + of_after.cost(j..segments)",
        replacement: "of_before.cost(0..j)",
        test: "-p tumble-identification --lib likelihood::flight::tests::cargo",
    },
    Mutant {
        name: "stages: sensors of each part their own",
        file: "crates/identification/src/likelihood/flight/stages.rs",
        original: "at(a, a) + at(b, b) - at(a, b) - at(b, a)",
        replacement: "at(a, a) + at(b, b)",
        test: "-p tumble-identification --lib likelihood::flight::tests::cargo",
    },
    Mutant {
        name: "sensing: hidden latency dropped",
        file: "crates/astrobee/src/sensing/localization.rs",
        original: "let at = |index: usize| self.history.get(index.min(oldest)).copied();",
        replacement: "let at = |_: usize| self.history.front().copied();",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: bias known without lag",
        file: "crates/astrobee/src/sensing/localization.rs",
        original: "self.chain.update(&sample, &self.believed_bias)",
        replacement: "self.chain.update(&sample, &bias)",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: anomaly divides",
        file: "crates/astrobee/src/sensing/localization.rs",
        original: ".component_mul(&self.acceleration_factor)",
        replacement: ".component_div(&self.acceleration_factor)",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: slow errors driven too weakly",
        file: "crates/astrobee/src/sensing/localization.rs",
        original: "drive: drift_sigma * libm::sqrt(1.0 - decay * decay)",
        replacement: "drive: drift_sigma * (1.0 - decay)",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: estimates arrive in order of stamps",
        file: "crates/astrobee/src/sensing/localization.rs",
        original: "[place - 1].arrival_ns > self.on_the_way[place].arrival_ns",
        replacement: "[place - 1].stamp_ns > self.on_the_way[place].stamp_ns",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: bursts lose nothing",
        file: "crates/astrobee/src/sensing/faults.rs",
        original: "alone || time_ns < self.burst_until_ns",
        replacement: "alone",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "sensing: recovery as long as the jump",
        file: "crates/astrobee/src/sensing/faults.rs",
        original: "since_s) / self.recovery_s",
        replacement: "since_s) / self.duration_s",
        test: "-p tumble-astrobee --test suite sensing::",
    },
    Mutant {
        name: "thrusters: gas is spent freely",
        file: "crates/dynamics/src/actuation/thrusters.rs",
        original: "        programme.solve(Objective::LeastThrust);\n",
        replacement: "",
        test: "-p tumble-dynamics --test suite actuators::",
    },
    Mutant {
        name: "thrusters: a thruster may pull",
        file: "crates/dynamics/src/actuation/thrusters.rs",
        original: "if variable < N { (0.0, 1.0) }",
        replacement: "if variable < N { (-1.0, 1.0) }",
        test: "-p tumble-dynamics --test suite actuators::",
    },
    Mutant {
        name: "thrusters: bound of the other side",
        file: "crates/dynamics/src/actuation/thrusters.rs",
        original: "let bound = if rate > 0.0 { upper } else { lower };",
        replacement: "let bound = if rate > 0.0 { lower } else { upper };",
        test: "-p tumble-dynamics --test suite actuators::",
    },
    Mutant {
        name: "thrusters: lever turned round",
        file: "crates/dynamics/src/actuation/thrusters.rs",
        original: "self.position_body.cross(&force)",
        replacement: "force.cross(&self.position_body)",
        test: "-p tumble-dynamics --test suite actuators::",
    },
    Mutant {
        name: "pulses: the shortest is not kept",
        file: "crates/dynamics/src/actuation/thrusters.rs",
        original: "ticks.max(shortest_ticks).min(ticks_per_period)",
        replacement: "ticks.min(ticks_per_period)",
        test: "-p tumble-dynamics --test suite actuators::",
    },
    Mutant {
        name: "rotors: drag lost",
        file: "crates/dynamics/src/actuation/rotors.rs",
        original: "self.position_body.cross(&force) + axis * self.drag_coefficient",
        replacement: "self.position_body.cross(&force)",
        test: "-p tumble-dynamics --test suite actuators::",
    },
    Mutant {
        name: "rotors: cut one by one instead of scaled",
        file: "crates/dynamics/src/actuation/rotors.rs",
        original: "efforts / efforts.amax().max(1.0)",
        replacement: "efforts.map(|effort| effort.min(1.0))",
        test: "-p tumble-dynamics --test suite actuators::",
    },
    Mutant {
        name: "reaction wheels: a full wheel spins on",
        file: "crates/dynamics/src/actuation/reaction_wheels.rs",
        original: "to_reach(largest).min(torque).max(0.0)",
        replacement: "torque",
        test: "-p tumble-dynamics --test suite actuators::",
    },
    Mutant {
        name: "reaction wheels: gyroscopic torque turned round",
        file: "crates/dynamics/src/gyrostat.rs",
        original: "input.stored_at(time_s).cross(&state.twist_body.angular)",
        replacement: "state.twist_body.angular.cross(&input.stored_at(time_s))",
        test: "-p tumble-dynamics --test suite planted_defects_bodies::",
    },
    Mutant {
        name: "CSV: lines of any length",
        file: "crates/formats/src/log/row.rs",
        original: "if self.bytes_in_line > ROW_LIMIT_BYTES {",
        replacement: "if self.bytes_in_line > ROW_LIMIT_BYTES << 8 {",
        test: "-p tumble --test suite corruption_sweep::",
    },
    Mutant {
        name: "CSV: lines counted without comments",
        file: "crates/formats/src/log/row.rs",
        original: "record.set_position(Some(position.set_line(line).clone()));",
        replacement: "let _ = position.set_line(line);",
        test: "-p tumble-formats --lib log",
    },
    Mutant {
        name: "TOML: control characters reach the terminal",
        file: "crates/formats/src/toml_text.rs",
        original: "Self::Unlike(error) => printable(error.message()),",
        replacement: "Self::Unlike(error) => error.message().to_owned(),",
        test: "-p tumble --test suite corruption_sweep::",
    },
    Mutant {
        name: "scenario: read whole, whatever its size",
        file: "crates/tumble/src/scenario.rs",
        original: "text_file::read(path)",
        replacement: "fs::read_to_string(path)",
        test: "-p tumble --test suite corruption_sweep::",
    },
    Mutant {
        name: "table of wrenches: times through a float",
        file: "crates/tumble/src/scenario/build.rs",
        original: "let time_ns = row.time_ns(time)?;",
        replacement: "let time_ns = flight_log::nanoseconds(row.number(time)? as f32 as f64);",
        test: "-p tumble --test suite corruption_sweep::",
    },
    Mutant {
        name: "throws: an open quote swallows the file",
        file: "crates/formats/src/wheel_throw.rs",
        original: "        .quoting(false)\n",
        replacement: "",
        test: "-p tumble --test suite corruption_sweep::",
    },
    Mutant {
        name: "messages: control characters reach the terminal",
        file: "crates/formats/src/text_file.rs",
        original: "if c.is_control() && c != '\\n'",
        replacement: "if false && c != '\\n'",
        test: "-p tumble --test suite corruption_sweep::",
    },
    Mutant {
        name: "text files: read whole, whatever their size",
        file: "crates/formats/src/text_file.rs",
        original: "if bytes.len() > LIMIT_BYTES {",
        replacement: "if bytes.len() > LIMIT_BYTES + 1 {",
        test: "-p tumble --test suite corruption_sweep::",
    },
    Mutant {
        name: "payload: at rest, yet with the robot's momentum",
        file: "crates/astrobee/src/simulator/payload.rs",
        original: "&body_momentum(robot, twist_body))",
        replacement: "&body_momentum(&(*robot + *payload), twist_body))",
        test: "-p tumble-astrobee --test suite simulator::",
    },
    Mutant {
        name: "payload: grasp pose turned round when it is attached",
        file: "crates/astrobee/src/simulator.rs",
        original: "grasp.payload.transformed_by(&grasp.robot_from_payload)",
        replacement: "grasp.payload.transformed_by(&grasp.robot_from_payload.inverse())",
        test: "-p tumble-astrobee --test suite simulator::",
    },
    Mutant {
        name: "payload: released with the robot's twist instead of its own",
        file: "crates/astrobee/src/simulator/payload.rs",
        original: "robot.twist_body.transformed_by(&grasp.robot_from_payload.inverse())",
        replacement: "robot.twist_body",
        test: "-p tumble-astrobee --test suite simulator::",
    },
    Mutant {
        name: "payload: the body stays laden after the release",
        file: "crates/astrobee/src/simulator.rs",
        original: "        self.take_load(None);\n        self.push_event(Event::PayloadReleased);",
        replacement: "        self.held = None;\n        self.push_event(Event::PayloadReleased);",
        test: "-p tumble-astrobee --test suite simulator::",
    },
    Mutant {
        name: "table: first moment out of the plane kept",
        file: "crates/astrobee/src/simulator/payload.rs",
        original: "Vector3::new(body.first_moment.x, body.first_moment.y, 0.0)",
        replacement: "body.first_moment",
        test: "-p tumble-astrobee --test suite simulator::",
    },
    Mutant {
        name: "continuous test: the bound of a turn added",
        file: "crates/planning/src/collision/sweep.rs",
        original: "clearance[2] -= 0.5 * bend * rate_rad_s * rate_rad_s;",
        replacement: "clearance[2] += 0.5 * bend * rate_rad_s * rate_rad_s;",
        test: "-p tumble-planning --test suite sweeps::",
    },
    Mutant {
        name: "continuous test: slope of a turn turned round",
        file: "crates/planning/src/collision/sweep.rs",
        original: "*clearance += rise * angle;",
        replacement: "*clearance -= rise * angle;",
        test: "-p tumble-planning --test suite sweeps::",
    },
    Mutant {
        name: "continuous test: way backwards not mirrored",
        file: "crates/planning/src/collision/sweep.rs",
        original: "*coefficient = -*coefficient;",
        replacement: "*coefficient = 1.0 * *coefficient;",
        test: "-p tumble-planning --test suite sweeps::",
    },
    Mutant {
        name: "continuous test: the second root for the first",
        file: "crates/planning/src/collision/polynomial.rs",
        original: "2.0 * value / (f64::sqrt(discriminant) - slope)",
        replacement: "2.0 * value / (-f64::sqrt(discriminant) - slope)",
        test: "-p tumble-planning --test suite sweeps::",
    },
    Mutant {
        name: "collision world: moving obstacle without its own clock",
        file: "crates/planning/src/collision/world.rs",
        original: "COEFFICIENTS - 1, start_s - motion.since_s)",
        replacement: "COEFFICIENTS - 1, start_s)",
        test: "-p tumble-planning --test suite ellipsoid_world::",
    },
    Mutant {
        name: "collision world: appearing in the arc's time",
        file: "crates/planning/src/collision/world.rs",
        original: "f64::max(0.0, entry.appear_s - start_s)",
        replacement: "f64::max(0.0, entry.appear_s)",
        test: "-p tumble-planning --test suite ellipsoid_world::",
    },
    Mutant {
        name: "broad phase: the last box of a leaf lost",
        file: "crates/planning/src/collision/broad_phase.rs",
        original: "end: first + boxes.len(), is_leaf",
        replacement: "end: first + boxes.len() - 1, is_leaf",
        test: "-p tumble-planning --test suite ellipsoid_world::",
    },
    Mutant {
        name: "batch of poses: radius left out of what is worth asking",
        file: "crates/planning/src/collision/batch.rs",
        original: "limits_m[lane] = clearance_m + radius_m;",
        replacement: "limits_m[lane] = *clearance_m;",
        test: "-p tumble-planning --test suite ellipsoid_world::",
    },
    Mutant {
        name: "bound: a step counted too many",
        file: "crates/planning/src/global/bound.rs",
        original: "(depth_s + f64::from(steps - 1) * edge_s)",
        replacement: "(depth_s + f64::from(steps) * edge_s)",
        test: "-p tumble-planning --test suite bounds::",
    },
    Mutant {
        name: "bound: cells blocked by their centre alone",
        file: "crates/planning/src/global/bound/survey.rs",
        original: "if upper + half_diagonal_m < margin_m {",
        replacement: "if upper < margin_m {",
        test: "-p tumble-planning --test suite bounds::",
    },
    Mutant {
        name: "bound: cells free by their centre alone",
        file: "crates/planning/src/global/bound/survey.rs",
        original: "} else if lower - half_diagonal_m >= margin_m {",
        replacement: "} else if lower >= margin_m {",
        test: "-p tumble-planning --test suite bounds::",
    },
    Mutant {
        name: "bound: clearance of the coarser grid taken over as it is",
        file: "crates/planning/src/global/bound/survey.rs",
        original: "        [lower - away, upper + away]",
        replacement: "        [lower, upper - away]",
        test: "-p tumble-planning --test suite bounds::",
    },
    Mutant {
        name: "bound: a turn beyond the goal although the goal lies farther",
        file: "crates/planning/src/global/bound/turning.rs",
        original: "                if near <= beyond {",
        replacement: "                if near <= -beyond.abs() {",
        test: "-p tumble-planning --test suite bounds::",
    },
    Mutant {
        name: "bound: way back from a turn as long as the way out",
        file: "crates/planning/src/global/bound/turning.rs",
        original: "farthest_m - self.sign * metric.goal[axis] - metric.radius_m)",
        replacement: "farthest_m + self.sign * metric.goal[axis] + metric.radius_m)",
        test: "-p tumble-planning --test suite bounds::",
    },
    Mutant {
        name: "bound: time of the obstacles there are now instead of what lasts",
        file: "crates/planning/src/global/bound/survey.rs",
        original: "request.world.lasting_clearance(request.body, &world_from_body, request.start_s)?",
        replacement: "request.world.clearance(request.body, &world_from_body, request.start_s)?",
        test: "-p tumble-planning --test suite bounds::",
    },
    Mutant {
        name: "bound: twice what is lost in speeding up",
        file: "crates/planning/src/global/bound/least_time.rs",
        original: "/ (2.0 * acceleration);\n        length + lost",
        replacement: "/ acceleration;\n        length + lost",
        test: "-p tumble-planning --lib",
    },
    Mutant {
        name: "steering: durations without a gap",
        file: "crates/planning/src/steering/axis.rs",
        original: "if low > 0.0 {",
        replacement: "if low > f64::MAX {",
        test: "-p tumble-planning --test suite steering::",
    },
    Mutant {
        name: "steering: displacement of the direct change of speed",
        file: "crates/planning/src/steering/axis.rs",
        original: "let displacement = 0.5 * (v0 + v1) * direct_s;",
        replacement: "let displacement = 0.5 * (v0 - v1) * direct_s;",
        test: "-p tumble-planning --test suite steering::",
    },
    Mutant {
        name: "steering: coast on the wrong side of the lower speed",
        file: "crates/planning/src/steering/axis.rs",
        original: "self.low - beyond(below)",
        replacement: "self.low + beyond(below)",
        test: "-p tumble-planning --test suite steering::",
    },
    Mutant {
        name: "steering: turn before the coast forgotten",
        file: "crates/planning/src/steering/axis.rs",
        original: "include(p0 - 0.5 * v0 * v0 / self.acceleration[0]);",
        replacement: "include(p0);",
        test: "-p tumble-planning --test suite steering::",
    },
    Mutant {
        name: "steering: rounding may hide an isolated duration",
        file: "crates/planning/src/steering/axis.rs",
        original: "let sure = (surplus - self.slack).max(0.0);",
        replacement: "let sure = surplus;",
        test: "-p tumble-planning --test suite steering::",
    },
    Mutant {
        name: "goal bound: room before the region is overshot",
        file: "crates/planning/src/steering/goal.rs",
        original: "let left = forward * forward - 2.0 * acceleration * given;",
        replacement: "let left = forward * forward - acceleration * given;",
        test: "-p tumble-planning --test suite steering::",
    },
    Mutant {
        name: "least impulse: patience without a stop",
        file: "crates/planning/src/steering/axis.rs",
        original: "            -high - low\n",
        replacement: "            high - low\n",
        test: "-p tumble-planning --test suite steering::",
    },
    Mutant {
        name: "slew: no centripetal torque",
        file: "crates/planning/src/steering/slew.rs",
        original: "let left = self.limit[axis] - squared_rate * self.centripetal[axis];",
        replacement: "let left = self.limit[axis];",
        test: "-p tumble-planning --test suite slew::",
    },
    Mutant {
        name: "distance: curvature of the second body with the wrong sign",
        file: "crates/planning/src/collision/distance.rs",
        original: "            + (self.shapes[1] -",
        replacement: "            - (self.shapes[1] -",
        test: "-p tumble-planning --test suite distances::",
    },
    Mutant {
        name: "distance: a hint from behind is believed",
        file: "crates/planning/src/collision/distance.rs",
        original: "Some(hint) if hint.width_m > 0.0 => pair.finish(hint, None),",
        replacement: "Some(hint) if hint.width_m.is_finite() => pair.finish(hint, None),",
        test: "-p tumble-planning --test suite distances::",
    },
    Mutant {
        name: "distance: rounding counted the wrong way",
        file: "crates/planning/src/collision/distance.rs",
        original: "let noise_m = 8.0 * f64::EPSILON",
        replacement: "let noise_m = -8.0 * f64::EPSILON",
        test: "-p tumble-planning --test suite distances::",
    },
    Mutant {
        name: "distance: one start for the depth",
        file: "crates/planning/src/collision/distance.rs",
        original: "                    best = best.or_wider(self.widest(self.slab(normal), best.width_m, None));",
        replacement: "                    let _ = self.slab(normal);",
        test: "-p tumble-planning --test suite distances::",
    },
    Mutant {
        name: "distance: a point on the medial plane leaves along it",
        file: "crates/planning/src/collision/sphere.rs",
        original: "side * f64::sqrt((1.0 - sum).max(0.0)) / self",
        replacement: "0.0 * side * f64::sqrt((1.0 - sum).max(0.0)) / self",
        test: "-p tumble-planning --test suite distances::",
    },
    Mutant {
        name: "distance: the far side of an ellipsoid is not looked at from within a box",
        file: "crates/planning/src/collision/aligned_box.rs",
        original: "if nearest.dot(&at) - slab.height > best.width_m",
        replacement: "if nearest.dot(&at) - slab.height < best.width_m",
        test: "-p tumble-planning --test suite distances::",
    },
    Mutant {
        name: "distance: ellipse along an edge turned the other way",
        file: "crates/planning/src/collision/aligned_box.rs",
        original: "normal[j] = y * u + x * v;",
        replacement: "normal[j] = y * u - x * v;",
        test: "-p tumble-planning --test suite distances::",
    },
    Mutant {
        name: "keep-in: boxes that differ by rounding leave a wall",
        file: "crates/planning/src/collision/keep_in.rs",
        original: "if gap_m < KEEP_IN_GAP_M {",
        replacement: "if gap_m < 0.0 {",
        test: "-p tumble-planning --test suite distances::",
    },
    Mutant {
        name: "keep-in: boxes outside dropped though nothing else covers them",
        file: "crates/planning/src/collision/keep_in.rs",
        original: "covered[self.index(cell)] > 1)",
        replacement: "covered[self.index(cell)] > 0)",
        test: "-p tumble-planning --test suite distances::",
    },
    Mutant {
        name: "ellipsoid pairs: a plane taken as proof within its rounding",
        file: "crates/planning/src/collision/contact_function.rs",
        original: "- error_bound::<N>(size, self.lengths)",
        replacement: "+ error_bound::<N>(size, self.lengths)",
        test: "-p tumble-planning --test suite ellipsoid_pairs::",
    },
    Mutant {
        name: "ellipsoid pairs: rounding of the common point forgotten",
        file: "crates/planning/src/collision/contact_function.rs",
        original: "left > 0.0 && left * room > found.residual(&pair)",
        replacement: "left > 0.0",
        test: "-p tumble-planning --test suite ellipsoid_pairs::",
    },
    Mutant {
        name: "ellipsoid pairs: the common point taken from the thicker solid",
        file: "crates/planning/src/collision/contact_function.rs",
        original: "&found, smallest_a < smallest_b)",
        replacement: "&found, smallest_a > smallest_b)",
        test: "-p tumble-planning --test suite ellipsoid_pairs::",
    },
    Mutant {
        name: "ellipsoid pairs: nothing decided beyond 53 bits",
        file: "crates/planning/src/collision/contact_function.rs",
        original: "const STEPS: usize = 40;",
        replacement: "const STEPS: usize = 0;",
        test: "-p tumble-planning --test suite ellipsoid_pairs::",
    },
    Mutant {
        name: "double-double: split a bit off the middle",
        file: "crates/planning/src/collision/double_double.rs",
        original: "134_217_729.0",
        replacement: "1_048_577.0",
        test: "-p tumble-planning --lib collision::double_double",
    },
    Mutant {
        name: "margin: attitudes bend nothing",
        file: "crates/planning/src/collision/margin.rs",
        original: "aa * 2.0 - turn_a.bend,",
        replacement: "aa * 2.0,",
        test: "-p tumble-planning --test suite ellipsoid_pairs::",
    },
    Mutant {
        name: "margin: the weight of b held still where its shape turns",
        file: "crates/planning/src/collision/margin.rs",
        original: "* 2.0 - turn_b.slope,",
        replacement: "* 2.0,",
        test: "-p tumble-planning --test suite ellipsoid_pairs::",
    },
    Mutant {
        name: "margin: square root of the contact function differentiated once only",
        file: "crates/planning/src/collision/margin.rs",
        original: "let of_gradient = -1.0 / growth;",
        replacement: "let of_gradient = 0.0;",
        test: "-p tumble-planning --test suite ellipsoid_pairs::",
    },
    Mutant {
        name: "double integrator: velocity forgets the force",
        file: "crates/planning/src/kinodynamic/double_integrator.rs",
        original: "velocity: state.velocity + acceleration_world * duration_s",
        replacement: "velocity: state.velocity",
        test: "-p tumble-planning --test suite planted_defects_planners::",
    },
    Mutant {
        name: "double integrator: Euler falls behind twice as far",
        file: "crates/planning/src/kinodynamic/double_integrator.rs",
        original: "acceleration_world * (0.5 * duration_s / steps)",
        replacement: "acceleration_world * (duration_s / steps)",
        test: "-p tumble-planning --lib double_integrator",
    },
    Mutant {
        name: "motion in a box: a control point off",
        file: "crates/planning/src/kinodynamic.rs",
        original: "[1.0, 0.4, 0.1, 0.0, 0.0, 0.0]",
        replacement: "[1.0, 0.4, 0.0, 0.0, 0.0, 0.0]",
        test: "-p tumble-planning --lib kinodynamic",
    },
    Mutant {
        name: "primitive RRT: edges checked as if they all began at the start",
        file: "crates/planning/src/global/primitive_rrt.rs",
        original: "let start_s = self.request.start_s + from.time_s;",
        replacement: "let start_s = self.request.start_s;",
        test: "-p tumble-planning --test suite primitive_rrt::",
    },
    Mutant {
        name: "primitive RRT: the primitive that ends farthest",
        file: "crates/planning/src/global/primitive_rrt.rs",
        original: "is_none_or(|(least, _)| distance < *least)",
        replacement: "is_none_or(|(least, _)| distance > *least)",
        test: "-p tumble-planning --test suite planted_defects_planners::",
    },
    Mutant {
        name: "planning: needles accepted",
        file: "crates/planning/src/error.rs",
        original: "largest <= smallest * THINNEST",
        replacement: "largest <= smallest * f64::MAX",
        test: "-p tumble-planning --test suite hostile_numbers::",
    },
    Mutant {
        name: "planning: an attitude of any norm",
        file: "crates/planning/src/error.rs",
        original: "const UNIT: f64 = 1e-3;",
        replacement: "const UNIT: f64 = 1e300;",
        test: "-p tumble-planning --test suite hostile_numbers::",
    },
    Mutant {
        name: "planning: huge numbers accepted",
        file: "crates/planning/src/error.rs",
        original: "between(what, finite(what, value)?, -LARGEST, LARGEST)",
        replacement: "between(what, finite(what, value)?, f64::MIN, f64::MAX)",
        test: "-p tumble-planning --test suite hostile_numbers::",
    },
    Mutant {
        name: "steering: any acceleration accepted",
        file: "crates/planning/src/steering/axis.rs",
        original: "if !(is_within && is_moderate && is_push)",
        replacement: "if !(is_within && is_moderate)",
        test: "-p tumble-planning --test suite hostile_numbers::",
    },
    Mutant {
        name: "steering: no time is a time",
        file: "crates/planning/src/steering/axis.rs",
        original: "let is_enough = latest_s >= durations.least_s;",
        replacement: "let is_enough = !(latest_s < durations.least_s);",
        test: "-p tumble-planning --test suite hostile_numbers::",
    },
    Mutant {
        name: "box: no number is inside",
        file: "crates/planning/src/collision/aligned_box.rs",
        original: "if apart.is_nan() { apart } else { f64::NEG_INFINITY }",
        replacement: "f64::NEG_INFINITY",
        test: "-p tumble-planning --test suite hostile_numbers::",
    },
    Mutant {
        name: "sweep: a contact is an absolute length",
        file: "crates/planning/src/collision/sweep.rs",
        original: "contact_m: CONTACT * lengths_m }",
        replacement: "contact_m: 1e-9 }",
        test: "-p tumble-planning --test suite equivariance::",
    },
    Mutant {
        name: "distance: an absolute residual",
        file: "crates/planning/src/collision/distance.rs",
        original: "let residual = RESIDUAL * slab.width_m.abs() + noise;",
        replacement: "let residual = RESIDUAL;",
        test: "-p tumble-planning --test suite equivariance::",
    },
    Mutant {
        name: "parry: the distance of two points for that of two planes",
        file: "crates/planning/src/collision/parry/piece.rs",
        original: "bounds.lower_m = bounds.lower_m.max(-next.point.dot(toward));",
        replacement: "bounds.lower_m = bounds.lower_m.max(distance_m);",
        test: "-p tumble-planning --features parry --test parry_world",
    },
    Mutant {
        name: "parry: the layer of one piece only",
        file: "crates/planning/src/collision/parry/piece.rs",
        original: "let layers_m = a.layer_m + b.layer_m;",
        replacement: "let layers_m = a.layer_m;",
        test: "-p tumble-planning --features parry --test parry_world",
    },
    Mutant {
        name: "parry: a reach without the layer",
        file: "crates/planning/src/collision/parry/piece.rs",
        original: "sphere.center.length() + sphere.radius) + layer_m;",
        replacement: "sphere.center.length() + sphere.radius);",
        test: "-p tumble-planning --features parry --test parry_world",
    },
    Mutant {
        name: "parry: a turned box with its old extents",
        file: "crates/planning/src/collision/parry.rs",
        original: "let half_extent = turned.abs() * ((upper - lower) * 0.5);",
        replacement: "let half_extent = (upper - lower) * 0.5;",
        test: "-p tumble-planning --features parry --test parry_world",
    },
    Mutant {
        name: "parry: what lasts taken for as near as it may be",
        file: "crates/planning/src/collision/parry.rs",
        original: "distance_m: nearest.upper_m, nearest",
        replacement: "distance_m: nearest.lower_m, nearest",
        test: "-p tumble-planning --features parry --test parry_world",
    },
    Mutant {
        name: "parry: overlaps measured from one side only",
        file: "crates/planning/src/collision/parry/piece.rs",
        original: "for first in [centers, Vector::X, Vector::Y, Vector::Z, -Vector::X, -Vector::Y, -Vector::Z] {",
        replacement: "for first in [centers] {",
        test: "-p tumble-planning --features parry --test parry_world",
    },
    Mutant {
        name: "batch of poses: the nearest ellipsoid's upper bound too low",
        file: "crates/planning/src/collision/batch.rs",
        original: "f64::max(0.0, apart_m - apart_m / f64::sqrt(*squared))",
        replacement: "f64::max(0.0, 0.3 * (apart_m - apart_m / f64::sqrt(*squared)))",
        test: "-p tumble-planning --test suite ellipsoid_world::",
    },
    Mutant {
        name: "batch of poses: support of the plane side by side",
        file: "crates/planning/src/collision/batch.rs",
        original: "height += normal * normal * semi_axis * semi_axis;",
        replacement: "height += normal * normal * semi_axis;",
        test: "-p tumble-planning --test suite ellipsoid_world::",
    },
    Mutant {
        name: "flight planner: a shortcut is not checked",
        file: "crates/planning/src/global/flight_planner/improve.rs",
        original: "if !is_gain || !search.is_free(middle, from.time_s)? {",
        replacement: "if !is_gain {",
        test: "-p tumble-planning --test suite flight_planner::",
    },
    Mutant {
        name: "flight planner: mission time begins with the plan",
        file: "crates/planning/src/global/flight_planner/search.rs",
        original: "self.request.start_s + start_s + since_s",
        replacement: "start_s + since_s",
        test: "-p tumble-planning --test suite flight_planner::",
    },
    Mutant {
        name: "flight planner: the splice counts from the start of the old plan",
        file: "crates/planning/src/global/flight_planner/replan.rs",
        original: "let splice_s = started_s + cut.time_s;",
        replacement: "let splice_s = cut.time_s;",
        test: "-p tumble-planning --test suite flight_planner::",
    },
    Mutant {
        name: "flight planner: what lies behind a shortcut is not checked at its new times",
        file: "crates/planning/src/global/flight_planner/improve.rs",
        original: ".filter(|_| !search.is_still)",
        replacement: ".filter(|_| false)",
        test: "-p tumble-planning --test suite flight_planner::",
    },
    Mutant {
        name: "flight planner: a goal anywhere in attitude is looked at with that of the start",
        file: "crates/planning/src/global/flight_planner.rs",
        original: "request.goal.attitude.unwrap_or_else(|| search.attitude())",
        replacement: "request.goal.attitude.unwrap_or(request.attitude)",
        test: "-p tumble-planning --test suite flight_planner::",
    },
    Mutant {
        name: "diagnosis: the goal region at the attitude of the start",
        file: "crates/planning/src/global/diagnosis.rs",
        original: "request.goal.attitude.or(",
        replacement: "Some(request.attitude).or(",
        test: "-p tumble-planning --test suite flight_planner::",
    },
    Mutant {
        name: "planner: a wait that the plan leaves out",
        file: "crates/planning/src/global/flight_planner/connect.rs",
        original: "flight.arcs.insert(0, search.wait(root.at_s));",
        replacement: "",
        test: "-p tumble-planning --test suite flight_planner::",
    },
    Mutant {
        name: "local plan: no multiplier of a quadratic program leaves",
        file: "crates/planning/src/local/quadratic_program.rs",
        original: "(drop_at, length) = (Some(position), other / change);",
        replacement: "length = f64::min(length, other / change * 1e300);",
        test: "-p tumble-planning --lib local::quadratic_program",
    },
    Mutant {
        name: "local plan: a rotation turned the wrong way",
        file: "crates/planning/src/local/quadratic_program.rs",
        original: "self.factor[start + 1] = cosine * lower - sine * upper;",
        replacement: "self.factor[start + 1] = cosine * lower + sine * upper;",
        test: "-p tumble-planning --lib local::quadratic_program",
    },
    Mutant {
        name: "local plan: pairs that are not damped",
        file: "crates/planning/src/local/quasi_newton.rs",
        original: "learned < LEAST_SHARE * known",
        replacement: "learned < f64::NEG_INFINITY * known",
        test: "-p tumble-planning --lib local::quasi_newton",
    },
    Mutant {
        name: "local plan: a penalty that does not grow",
        file: "crates/planning/src/local/sqp.rs",
        original: "(self.penalty, self.stuck) = (4.0 * self.penalty, 0);",
        replacement: "self.stuck = 0;",
        test: "-p tumble-planning --lib local::sqp",
    },
    Mutant {
        name: "local plan: converged beside its rows",
        file: "crates/planning/src/local/sqp.rs",
        original: "if is_feasible && optimality < settings.tolerance {",
        replacement: "if optimality < settings.tolerance {",
        test: "-p tumble-planning --lib local::sqp",
    },
    Mutant {
        name: "local plan: worse where rows are kept",
        file: "crates/planning/src/local/sqp.rs",
        original: "(is_feasible, _) => is_feasible && self.cost.is_finite(),",
        replacement: "(is_feasible, _) => !is_feasible,",
        test: "-p tumble-planning --lib local::sqp",
    },
    Mutant {
        name: "rigid body step: attitude's second change forgets the length of the quaternion",
        file: "crates/planning/src/local/rigid_body/turning.rs",
        original: "add(row, -factor * changed, &turn.raw);",
        replacement: "add(row, 0.0 * changed, &turn.raw);",
        test: "-p tumble-planning --lib rigid_body",
    },
    Mutant {
        name: "rigid body step: the inertia's change leaves its inverse",
        file: "crates/planning/src/local/rigid_body/turning.rs",
        original: "RotorChange { is_none: inertia.iter().all(is_zero), inverse: product(&minus, &self.inverse), bend }",
        replacement: "RotorChange { is_none: inertia.iter().all(is_zero), inverse: [[0.0; 3]; 3], bend }",
        test: "-p tumble-planning --lib rigid_body",
    },
    Mutant {
        name: "rigid body step: the centre of mass is not swept along",
        file: "crates/planning/src/local/rigid_body/step.rs",
        original: "let has_lever = !is_zero(c);",
        replacement: "let has_lever = false;",
        test: "-p tumble-planning --lib rigid_body",
    },
    Mutant {
        name: "rigid body step: a commanded force's scale does not change with the force",
        file: "crates/planning/src/local/rigid_body/step.rs",
        original: "let push_by_force = direction.force_scale.map(|s| direction.mass_inverse + body.mass_inverse * s);",
        replacement: "let push_by_force = [direction.mass_inverse; 3];",
        test: "-p tumble-planning --lib rigid_body",
    },
    Mutant {
        name: "rigid body knowledge: the first moment's error is not the centre of mass's",
        file: "crates/planning/src/local/rigid_body/parameters.rs",
        original: "first_moment: (h - c * change.mass) / body.mass,",
        replacement: "first_moment: h / body.mass,",
        test: "-p tumble-planning --lib rigid_body",
    },
    Mutant {
        name: "parametric model: sensitivity measured from where the step ends without the lane",
        file: "crates/planning/src/local/parametric.rs",
        original: "HyperDual64::new(0.0, 0.0, along_lane[i].eps2, 0.0)",
        replacement: "HyperDual64::new(0.0, 0.0, 0.0 * along_lane[i].eps2, 0.0)",
        test: "-p tumble-planning --test suite informative_models::",
    },
    Mutant {
        name: "parametric model: the sensitivity's own parameters held",
        file: "crates/planning/src/local/parametric.rs",
        original: "HyperDual64::new(self.values[i], parameters[i], 0.0, 0.0)",
        replacement: "HyperDual64::new(self.values[i], 0.0 * parameters[i], 0.0, 0.0)",
        test: "-p tumble-planning --test suite informative_models::",
    },
    Mutant {
        name: "planar body: centrifugal acceleration dropped from the stages",
        file: "crates/planning/src/local/planar_body/motion.rs",
        original: "let square = rate * rate;",
        replacement: "let square = (rate * rate).scaled(0.0);",
        test: "-p tumble-planning --lib planar_body",
    },
    Mutant {
        name: "planar body: second derivative of the cosine",
        file: "crates/planning/src/local/planar_body/motion.rs",
        original: "heading.chained(cos, -sin, -cos)",
        replacement: "heading.chained(cos, -sin, cos)",
        test: "-p tumble-planning --test suite informative_models::",
    },
    Mutant {
        name: "knowledge: correlations of the prior forgotten",
        file: "crates/planning/src/local/knowledge.rs",
        original: "correlation[(i, j)] = 0.5 * (entry + mirrored) / scale;",
        replacement: "correlation[(i, j)] = 0.0 * (entry + mirrored) / scale;",
        test: "-p tumble-planning --lib knowledge",
    },
    Mutant {
        name: "curvature: the arrow's columns without the inputs' answer",
        file: "crates/planning/src/local/curvature/riccati.rs",
        original: "add_transpose_product(&stage.gain, rows, &mut earlier);",
        replacement: "",
        test: "-p tumble-planning --lib local::curvature",
    },
    Mutant {
        name: "curvature: no identity beside the arrow",
        file: "crates/planning/src/local/curvature/arrow.rs",
        original: "*diagonal += 1.0;",
        replacement: "*diagonal += 0.5;",
        test: "-p tumble-planning --lib local::curvature",
    },
    Mutant {
        name: "curvature: long columns are not corrected",
        file: "crates/planning/src/local/curvature/arrow.rs",
        original: "for _ in 0..=CORRECTIONS {",
        replacement: "for _ in 0..1 {",
        test: "-p tumble-planning --lib local::curvature",
    },
    Mutant {
        name: "curvature: the dense matrix is not damped",
        file: "crates/planning/src/local/curvature/dense.rs",
        original: "*diagonal += damping;",
        replacement: "",
        test: "-p tumble-planning --lib local::curvature",
    },
    Mutant {
        name: "clarabel: the box has no lower side",
        file: "crates/planning/src/local/clarabel_route.rs",
        original: "[*most, -least]",
        replacement: "[*most, 2.0 - least]",
        test: "-p tumble-planning --lib local::clarabel_route",
    },
    Mutant {
        name: "barriers: semi-axes only longer by the margin",
        file: "crates/planning/src/local/surroundings/gauge.rs",
        original: "f64::sqrt(a * a * (1.0 + margin_m / size_m) + margin_m * (margin_m + size_m))",
        replacement: "a + 0.0 * size_m + margin_m",
        test: "-p tumble-planning --test suite local_barriers::",
    },
    Mutant {
        name: "barriers: one interval with several stationary points not halved",
        file: "crates/planning/src/local/surroundings/gauge.rs",
        original: "if halvings > 0 {",
        replacement: "if halvings > HALVINGS {",
        test: "-p tumble-planning --test suite local_barriers::",
    },
    Mutant {
        name: "barriers: the end's attitude not seen by the start",
        file: "crates/planning/src/local/surroundings/turn.rs",
        original: "turn * moment - inverse * by_end_phi",
        replacement: "turn * moment",
        test: "-p tumble-planning --test suite local_barriers::",
    },
    Mutant {
        name: "barriers: a way without its bend in the search for the least gap",
        file: "crates/planning/src/local/surroundings/closest.rs",
        original: "let lowest = gaps.0 + (from.slope - 0.5 * bend * along) * along;",
        replacement: "let lowest = gaps.0.min(gaps.1) - 0.0 * along;",
        test: "-p tumble-planning --test suite local_barriers::",
    },
    Mutant {
        name: "barriers: an obstacle there for a part of a segment left out",
        file: "crates/planning/src/local/surroundings.rs",
        original: "put(if is_present(from_s, to_s) {",
        replacement: "put(if is_present(to_s, to_s) {",
        test: "-p tumble-planning --test suite local_barriers::",
    },
    Mutant {
        name: "passing: the nearest side only",
        file: "crates/planning/src/local/passing.rs",
        original: "(nearest.0 + turn) % DIRECTIONS",
        replacement: "(nearest.0 + 0 * turn) % DIRECTIONS",
        test: "-p tumble-planning --lib local::passing",
    },
    Mutant {
        name: "Algorithm 1: the decay turned round",
        file: "crates/planning/src/local/weighting/covariance.rs",
        original: "-self.beta * target / variance",
        replacement: "-self.beta * variance / target",
        test: "-p tumble-planning --lib covariance",
    },
    Mutant {
        name: "Algorithm 1: hysteresis forgotten",
        file: "crates/planning/src/local/weighting/covariance.rs",
        original: "if *is_off { self.return_factor } else { 1.0 }",
        replacement: "1.0",
        test: "-p tumble-planning --lib covariance",
    },
    Mutant {
        name: "tracking loss: position errors in body axes",
        file: "crates/planning/src/local/tracking_loss.rs",
        original: "reference.state.world_from_body.rotation * answer.acceleration_origin_body",
        replacement: "answer.acceleration_origin_body",
        test: "-p tumble-planning --test suite tracking_loss::",
    },
    Mutant {
        name: "tracking loss: rates not weighed",
        file: "crates/planning/src/local/tracking_loss.rs",
        original: "+ weights[rate] * row[i][1] * row[j][1]",
        replacement: "",
        test: "-p tumble-planning --test suite tracking_loss::",
    },
    Mutant {
        name: "belief weights: of the whole mission, not what is left of it",
        file: "crates/planning/src/local/weighting/belief.rs",
        original: "context.elapsed_s() + self.used_after_s",
        replacement: "self.used_after_s",
        test: "-p tumble-planning --test suite tracking_loss::",
    },
    Mutant {
        name: "limits between nodes: a quarter of the bend",
        file: "crates/planning/src/local/bends.rs",
        original: "[bend * (bounds.acceleration_m_s2 + lever), bend * 2.0 * own_turning * turn]",
        replacement: "[bend * (bounds.acceleration_m_s2 + lever), 0.5 * bend * own_turning * turn]",
        test: "-p tumble-planning --lib bends",
    },
    Mutant {
        name: "limits between nodes: no lever",
        file: "crates/planning/src/local/bends.rs",
        original: "bounds.acceleration_m_s2 + lever",
        replacement: "bounds.acceleration_m_s2",
        test: "-p tumble-planning --lib bends",
    },
    Mutant {
        name: "knowledge: what is known exactly is refused",
        file: "crates/planning/src/local/knowledge.rs",
        original: "f64::sqrt(variance).max(least)",
        replacement: "f64::sqrt(variance)",
        test: "-p tumble-planning --lib knowledge",
    },
    Mutant {
        name: "local plan: flown into an obstacle and handed out",
        file: "crates/planning/src/local/flown.rs",
        original: "for attempt in 0..=FARTHER {",
        replacement: "for attempt in 0..=FARTHER - FARTHER {",
        test: "-p tumble-planning --lib local::flown",
    },
    Mutant {
        name: "gram program: a factor that gains what it loses",
        file: "crates/planning/src/control/gram_program/factor.rs",
        original: "weight *= pivot / updated;",
        replacement: "weight *= updated / pivot;",
        test: "-p tumble-planning --lib control::gram_program",
    },
    Mutant {
        name: "gram program: room is made on the wrong side",
        file: "crates/planning/src/control/gram_program/exchange.rs",
        original: "for_each(|factor| *factor *= -sign)",
        replacement: "for_each(|factor| *factor *= sign)",
        test: "-p tumble-planning --lib control::gram_program",
    },
    Mutant {
        name: "gram program: the proof is one of scaled rows",
        file: "crates/planning/src/control/gram_program/exchange.rs",
        original: "workspace.certificate[*row] = factor * program.scale(*row);",
        replacement: "workspace.certificate[*row] = *factor;",
        test: "-p tumble-planning --lib control::gram_program",
    },
    Mutant {
        name: "gram program: the factor of another program is kept",
        file: "crates/planning/src/control/gram_program/search.rs",
        original: "workspace.fingerprint == Some(program.fingerprint()) &&",
        replacement: "workspace.fingerprint.is_some() &&",
        test: "-p tumble-planning --lib control::gram_program",
    },
    Mutant {
        name: "gram program: only the upper bound of a row is looked at",
        file: "crates/planning/src/control/gram_program/search.rs",
        original: "if excess > tolerance && !workspace.is_active[row] {",
        replacement: "if above > tolerance && !workspace.is_active[row] {",
        test: "-p tumble-planning --lib control::gram_program",
    },
    Mutant {
        name: "cascade: decisions drift off their grid",
        file: "crates/planning/src/control/cascade.rs",
        original: "time_s < held.due_s + step_s => held.due_s + step_s",
        replacement: "time_s < held.due_s + step_s => time_s + step_s",
        test: "-p tumble-planning --test suite controllers::a_decision",
    },
    Mutant {
        name: "cascade: the origin turns about the centre of mass unseen",
        file: "crates/planning/src/control/cascade.rs",
        original: "angular.cross(moment) + rate.cross(&rate.cross(moment))",
        replacement: "angular.cross(moment) * 0.0 + rate.cross(&rate.cross(moment))",
        test: "-p tumble-planning --test suite controllers::on_its_reference",
    },
    Mutant {
        name: "believed body: an older belief comes back",
        file: "crates/planning/src/control/believed_body.rs",
        original: "belief.revision < self.revision",
        replacement: "belief.revision > u64::MAX - 1",
        test: "-p tumble-planning --test suite controllers::pose_tracking",
    },
    Mutant {
        name: "plain mpc: every node weighs like the last",
        file: "crates/planning/src/control/plain_mpc.rs",
        original: "weight = &self.node;",
        replacement: "weight = &self.last;",
        test: "-p tumble-planning --lib plain_mpc",
    },
    Mutant {
        name: "additive tube: an unknown mass moves nothing",
        file: "crates/planning/src/control/additive_tube.rs",
        original: "Vector2::new(0.5 * step_s * step_s, step_s) * apart",
        replacement: "Vector2::new(0.0, step_s) * apart",
        test: "-p tumble-planning --test suite original_tube::released",
    },
    Mutant {
        name: "original tube: the box is never halved",
        file: "crates/planning/src/control/original_tube.rs",
        original: "for share in [1.0, 0.5] {",
        replacement: "for share in [1.0, 1.0] {",
        test: "-p tumble-planning --test suite original_tube::where_no_force",
    },
    Mutant {
        name: "laws of controllers: any older revision may be named",
        file: "crates/planning/src/laws/controller.rs",
        original: "broken_unless(named == in_use)",
        replacement: "broken_unless(named <= in_use)",
        test: "-p tumble-planning --test suite planted_defects_controller::every_fault",
    },
    Mutant {
        name: "laws of controllers: a force through the origin turns nothing",
        file: "crates/planning/src/laws/free_body.rs",
        original: "wrench.torque - self.center_body.cross(&wrench.force)",
        replacement: "wrench.torque",
        test: "-p tumble-planning --lib free_body",
    },
    Mutant {
        name: "invariant set: the tail is left out",
        file: "crates/planning/src/control/invariant_set.rs",
        original: "upper: scale * (lower + tail)",
        replacement: "upper: scale * lower",
        test: "-p tumble-planning --test suite invariant_sets::ten_thousand",
    },
    Mutant {
        name: "invariant set: the tail ends too soon",
        file: "crates/planning/src/control/invariant_set.rs",
        original: "let tail = reach / (1.0 - contraction.rate());",
        replacement: "let tail = reach * (1.0 - contraction.rate());",
        test: "-p tumble-planning --test suite invariant_sets::ten_thousand",
    },
    Mutant {
        name: "invariant set: the direction is not transposed",
        file: "crates/planning/src/control/invariant_set.rs",
        original: "terms[lane] = power[(i, k)];",
        replacement: "terms[lane] = power[(k, i)];",
        test: "-p tumble-planning --test suite invariant_sets::exact_supports",
    },
    Mutant {
        name: "contraction: the rate of the square",
        file: "crates/planning/src/control/contraction.rs",
        original: "let rate = f64::sqrt(self::spectral_radius(&(in_measure.transpose() * in_measure))) * (1.0 + SAFETY);",
        replacement: "let rate = self::spectral_radius(&(in_measure.transpose() * in_measure)) * (1.0 + SAFETY);",
        test: "-p tumble-planning --lib control::contraction",
    },
    Mutant {
        name: "contraction: the reach to one side",
        file: "crates/planning/src/control/contraction.rs",
        original: "set.support(&direction).max(set.support(&-direction))",
        replacement: "set.support(&direction)",
        test: "-p tumble-planning --lib control::contraction",
    },
    Mutant {
        name: "Rakovic's set: not blown up",
        file: "crates/planning/src/control/rakovic.rs",
        original: "        sum / (1.0 - self.alpha)",
        replacement: "        sum * (1.0 - self.alpha)",
        test: "-p tumble-planning --test suite invariant_sets::four_approximations",
    },
    Mutant {
        name: "Rakovic's set: too few terms are taken",
        file: "crates/planning/src/control/rakovic.rs",
        original: "if alpha < 1.0 {",
        replacement: "if alpha < 3.0 {",
        test: "-p tumble-planning --test suite planted_defects_invariant_set::",
    },
    Mutant {
        name: "template: only the parallelogram of the eigenvectors",
        file: "crates/planning/src/control/axis_template.rs",
        original: "const ROUNDS: usize = 40;",
        replacement: "const ROUNDS: usize = 0;",
        test: "-p tumble-planning --lib control::axis_template",
    },
    Mutant {
        name: "template: bounds a step later",
        file: "crates/planning/src/control/axis_template.rs",
        original: "let (pair, _) = Self::best(shares, bounds);",
        replacement: "let (pair, _) = Self::best(&self.own[row + 2], bounds);",
        test: "-p tumble-planning --lib control::axis_template",
    },
    Mutant {
        name: "template: the disturbance of one side",
        file: "crates/planning/src/control/axis_template.rs",
        original: "set(&normal).max(set(&-normal))",
        replacement: "set(&normal).min(set(&-normal))",
        test: "-p tumble-planning --lib control::axis_template",
    },
    Mutant {
        name: "regulator: the cost of one doubling less",
        file: "crates/planning/src/control/riccati.rs",
        original: "        cost += added;\n        step *= by_step;",
        replacement: "        step *= by_step;",
        test: "-p tumble-planning --lib control::riccati",
    },
    Mutant {
        name: "attitude: the force's torque about the centre of mass turned round",
        file: "crates/planning/src/control/attitude.rs",
        original: "+ self.body.center_of_mass().cross(force_body_n)",
        replacement: "- self.body.center_of_mass().cross(force_body_n)",
        test: "-p tumble-planning --lib control::attitude::",
    },
    Mutant {
        name: "attitude: the wanted rate carried into axes that stand still",
        file: "crates/planning/src/control/attitude.rs",
        original: "- angular_velocity.cross(&wanted_angular_velocity);",
        replacement: "- angular_velocity.cross(&angular_velocity);",
        test: "-p tumble-planning --lib control::attitude::",
    },
    Mutant {
        name: "attitude certificate: between instants of measurement nothing moves",
        file: "crates/planning/src/control/attitude_certificate.rs",
        original: "let between = 1.0 + step_share * (1.0 + 1.0 / peak.gain);",
        replacement: "let between = 1.0;",
        test: "-p tumble-planning --lib control::attitude_certificate::",
    },
    Mutant {
        name: "attitude certificate: gyroscopic torque of half the rate",
        file: "crates/planning/src/control/attitude_certificate.rs",
        original: "quadratic: 4.0 * spread,",
        replacement: "quadratic: spread,",
        test: "-p tumble-planning --lib control::attitude_certificate::",
    },
    Mutant {
        name: "attitude certificate: one inertia instead of the worst at each time",
        file: "crates/planning/src/control/peak_gain.rs",
        original: "gain: 1.0 + log / core::f64::consts::E",
        replacement: "gain: 1.0",
        test: "-p tumble-planning --lib control::peak_gain::",
    },
    Mutant {
        name: "attitude certificate: a delay one step too short",
        file: "crates/planning/src/control/peak_gain.rs",
        original: "let parts = [(whole + 1, late_s), (whole, step_s - late_s)]",
        replacement: "let parts = [(whole, late_s), (whole.saturating_sub(1), step_s - late_s)]",
        test: "-p tumble-planning --lib control::peak_gain::",
    },
    Mutant {
        name: "inertia interval: the believed moments without their error",
        file: "crates/planning/src/control/inertia_interval.rs",
        original: "(believed_least - error).max(certain.least)",
        replacement: "believed_least.max(certain.least)",
        test: "-p tumble-planning --lib control::inertia_interval::",
    },
    Mutant {
        name: "axis problem: a small tube need not stop in time",
        file: "crates/planning/src/control/axis_problem.rs",
        original: "row[scale] -= stopping * step_s * self.scaled_acceleration;",
        replacement: "row[scale] -= 30.0 * stopping * step_s * self.scaled_acceleration;",
        test: "-p tumble-planning --lib control::axis",
    },
    Mutant {
        name: "axis problem: the mass makes no tube",
        file: "crates/planning/src/control/axis_problem.rs",
        original: "let matched = uncertainty * limit;",
        replacement: "let matched = 0.2 * uncertainty * limit;",
        test: "-p tumble-planning --test suite tube_controller::",
    },
    Mutant {
        name: "axis tube: braking ends beyond the wall",
        file: "crates/planning/src/control/axis_tube.rs",
        original: "let short = to_rest.min(reaching(self.walls_m[1] - tube)).max(reaching(self.walls_m[0] + tube));",
        replacement: "let short = to_rest;",
        test: "-p tumble-planning --lib control::axis_tube",
    },
    Mutant {
        name: "translation tube: what was certain is forgotten",
        file: "crates/planning/src/control/translation_tube.rs",
        original: "MassInterval::believed(belief, self.setup.settings.sigmas, &certain)?",
        replacement: "MassInterval::believed(belief, self.setup.settings.sigmas, &self.setup.settings.mass)?",
        test: "-p tumble-planning --test suite tube_controller::",
    },
    Mutant {
        name: "force box: a turned force stays in its box",
        file: "crates/planning/src/control/force_box.rs",
        original: "let turned = shape + across(&shape) * aside;",
        replacement: "let turned = shape;",
        test: "-p tumble-planning --lib control::force_box",
    },
    Mutant {
        name: "mass interval: the middle of the masses",
        file: "crates/planning/src/control/mass_interval.rs",
        original: "2.0 / (self.least_per_kg + self.largest_per_kg)",
        replacement: "0.5 * (self.least_kg() + self.largest_kg())",
        test: "-p tumble-planning --lib control::mass_interval",
    },
    Mutant {
        name: "coupled axes: planes without the part of the tube that scales",
        file: "crates/planning/src/control/coupled_axes.rs",
        original: "along.abs() * problems[i].scaled[2])]",
        replacement: "along * problems[i].scaled[2])]",
        test: "-p tumble-planning --test suite coupled_against_clarabel::",
    },
    Mutant {
        name: "coupled axes: planes without the part of the tube that is held",
        file: "crates/planning/src/control/coupled_axes.rs",
        original: "plane.normal[i].abs() * (self.problems[i].held[2] + self.problems[i].slack[0])",
        replacement: "plane.normal[i].abs() * self.problems[i].slack[0]",
        test: "-p tumble-planning --test suite coupled_against_clarabel::",
    },
    Mutant {
        name: "joint rows: products within a block only with themselves",
        file: "crates/planning/src/control/gram_program/blocks.rs",
        original: "sum += factor * other_factor * block.product(*row, *other);",
        replacement: "sum += factor * other_factor * f64::from(u8::from(row == other));",
        test: "-p tumble-planning --test suite coupled_against_clarabel::",
    },
    Mutant {
        name: "obstacle planes: the body's attitude error left out",
        file: "crates/planning/src/control/obstacle_planes.rs",
        original: "error_rad + 0.5 * turn_rad",
        replacement: "0.5 * turn_rad",
        test: "-p tumble-planning --test suite obstacle_planes::",
    },
    Mutant {
        name: "obstacle planes: the last segment holds in the attitude of its end only",
        file: "crates/planning/src/control/obstacle_planes.rs",
        original: "(EndAttitude::Any, Some(cover))",
        replacement: "(EndAttitude::Held, Some(cover))",
        test: "-p tumble-planning --test suite obstacle_planes::",
    },
    Mutant {
        name: "obstacle planes: a moving obstacle only where its segment begins",
        file: "crates/planning/src/control/obstacle_planes/hull.rs",
        original: "{ 1 } else { centers.len() }",
        replacement: "{ 1 } else { 1 }",
        test: "-p tumble-planning --test suite obstacle_planes::",
    },
    Mutant {
        name: "obstacle planes: rows of nodes out of reach by the middle of the reach alone",
        file: "crates/planning/src/control/obstacle_planes.rs",
        original: "normal.dot(&middle) + normal.abs().dot(&(half + tube_m))",
        replacement: "normal.dot(&middle) + normal.dot(&(half + tube_m))",
        test: "-p tumble-planning --test suite obstacle_planes::",
    },
    Mutant {
        name: "axis problem: nothing is kept for the motion between decisions",
        file: "crates/planning/src/control/axis_problem.rs",
        original: "slack: [errors[0] + overshoot, errors[1]],",
        replacement: "slack: errors,",
        test: "-p tumble-planning --test suite tube_missions::",
    },
    Mutant {
        name: "axis problem: a force from outside makes no tube",
        file: "crates/planning/src/control/axis_problem.rs",
        original: "template.unmatched[i] + outside * template.matched[i]",
        replacement: "template.unmatched[i]",
        test: "-p tumble-planning --test suite tube_missions::",
    },
    Mutant {
        name: "simulator: estimates carried back in time instead of to the present",
        file: "crates/astrobee/src/simulator/drive.rs",
        original: "translation.vector + estimate.velocity_origin_world * age_s",
        replacement: "translation.vector - estimate.velocity_origin_world * age_s",
        test: "-p tumble-astrobee --lib simulator::drive",
    },
    Mutant {
        name: "flown controller: computes again for the same estimate",
        file: "crates/astrobee/src/simulator/flown_controller.rs",
        original: "if self.last_stamp_ns != Some(estimate.stamp_ns) {",
        replacement: "if self.last_stamp_ns != Some(i64::MIN) {",
        test: "-p tumble-astrobee --lib simulator::flown_controller",
    },
    Mutant {
        name: "control account: a decision that goes on begins a new spell",
        file: "crates/astrobee/src/simulator/control_account.rs",
        original: "&& spell.until_ns >= time_ns",
        replacement: "&& spell.until_ns > time_ns",
        test: "-p tumble-astrobee --lib simulator::control_account",
    },
    Mutant {
        name: "walls: two rooms are as wide as the wider one",
        file: "crates/tumble/src/scenario/control.rs",
        original: "lower_world: found.lower_world.sup(&next.lower_world)",
        replacement: "lower_world: found.lower_world.inf(&next.lower_world)",
        test: "-p tumble --lib scenario::control",
    },
    Mutant {
        name: "beliefs: the standard deviation of the mass taken for its variance",
        file: "crates/tumble/src/scenario/control.rs",
        original: "belief.estimate.covariance[(0, 0)] = sigma_kg * sigma_kg;",
        replacement: "belief.estimate.covariance[(0, 0)] = sigma_kg;",
        test: "-p tumble --test suite simulate_control::",
    },
    Mutant {
        name: "missions: stops brake as hard as the believed mass allows",
        file: "crates/tumble/src/scenario/fly/numbers.rs",
        original: "STOP_SHARE * force / (heaviest * body.mass)",
        replacement: "STOP_SHARE * force / body.mass",
        test: "-p tumble --lib scenario::fly::tests::the_heaviest",
    },
    Mutant {
        name: "missions: planners push along each world axis what one body axis may",
        file: "crates/tumble/src/scenario/fly/bodies.rs",
        original: "numbers.force_limit_n.min() / libm::sqrt(3.0)",
        replacement: "numbers.force_limit_n.min()",
        test: "-p tumble --lib scenario::fly::tests::shares",
    },
    Mutant {
        name: "missions: on the table a belief that tilts",
        file: "crates/tumble/src/scenario/fly/bodies.rs",
        original: "if place.is_planar() { planar_part(&belief) } else { belief }",
        replacement: "belief",
        test: "-p tumble --lib scenario::fly::tests::on_the_table",
    },
    Mutant {
        name: "missions: an obstacle is seen before it should be",
        file: "crates/tumble/src/scenario/fly/bodies.rs",
        original: "table.seen_s.or(table.appear_s)",
        replacement: "table.appear_s.or(table.seen_s)",
        test: "-p tumble --lib scenario::fly::tests::obstacles",
    },
    Mutant {
        name: "draws: beliefs that are no bodies",
        file: "crates/tumble/src/scenario/fly/draw.rs",
        original: "moments.max() * (2.0 + THICKNESS) < moments.sum()",
        replacement: "moments.max() < moments.sum()",
        test: "-p tumble --lib scenario::fly::draw",
    },
    Mutant {
        name: "report: hostile names end the data",
        file: "crates/tumble/src/mission_report/data.rs",
        original: "            '<' | '>' | '&' |",
        replacement: "            '&' |",
        test: "-p tumble --test suite mission_report::hostile_names",
    },
    Mutant {
        name: "report: text of the record taken for elements",
        file: "crates/tumble/src/page/text.rs",
        original: "'<' => page.push_str(\"&lt;\")",
        replacement: "'<' => page.push('<')",
        test: "-p tumble --test suite mission_report::hostile_names",
    },
    Mutant {
        name: "report: an obstacle that stays is lost with its infinite time",
        file: "crates/tumble/src/mission/record.rs",
        original: "until.unwrap_or(f64::INFINITY)",
        replacement: "until.unwrap_or(0.0)",
        test: "-p tumble --test suite mission_report::the_embedded_record",
    },
    Mutant {
        name: "report: error told in units instead of standard deviations",
        file: "crates/tumble/src/mission_report/tables.rs",
        original: "number((row.estimate - row.truth) / row.sigma, 2)",
        replacement: "number(row.estimate - row.truth, 2)",
        test: "-p tumble --test suite mission_report::errors_are_told",
    },
    Mutant {
        name: "report: logarithmic plots drawn linearly",
        file: "crates/tumble/src/page/chart.rs",
        original: "libm::log10(value)",
        replacement: "value",
        test: "-p tumble --test suite mission_report::predicted_information",
    },
    Mutant {
        name: "page: the wrench of a node is that of its first row",
        file: "crates/tumble/src/report_page.rs",
        original: "sum.force + wrench.force",
        replacement: "wrench.force",
        test: "-p tumble --lib report_page",
    },
    Mutant {
        name: "page: what is left is correlated with itself only",
        file: "crates/tumble/src/report_page.rs",
        original: "values.iter().skip(lag)",
        replacement: "values.iter()",
        test: "-p tumble --lib report_page",
    },
    Mutant {
        name: "page: a plan's page tells how long this machine took",
        file: "crates/tumble/src/cli/plan.rs",
        original: "let shown = table(args, source, problem, answer, rows, None);",
        replacement: "let shown = table(args, source, problem, answer, rows, Some(times));",
        test: "-p tumble --test suite plan_command::the_same_seed",
    },
    Mutant {
        name: "campaign: a mission's seed follows from its row, not from its number",
        file: "crates/tumble/src/campaign/plan.rs",
        original: "seed: mission_seed(c.master_seed, k)",
        replacement: "seed: mission_seed(c.master_seed, row)",
        test: "-p tumble --lib campaign::",
    },
    Mutant {
        name: "campaign: a torn row is taken for whole",
        file: "crates/tumble/src/campaign/journal.rs",
        original: "(checksum == format!(\"{:08x}\", crc32fast::hash(row.as_bytes()))).then(",
        replacement: "(checksum.len() <= 8).then(",
        test: "-p tumble --lib campaign::",
    },
    Mutant {
        name: "campaign: rows of another part pass",
        file: "crates/tumble/src/campaign/merge.rs",
        original: "is_some_and(|mission| row.is_of(&mission))",
        replacement: "is_some()",
        test: "-p tumble --lib campaign::",
    },
    Mutant {
        name: "campaign: Wilson's interval as wide as the normal one",
        file: "crates/tumble/src/campaign/statistics.rs",
        original: "share * (1.0 - share) / n + z2 / (4.0 * n * n)",
        replacement: "share * (1.0 - share) / n",
        test: "-p tumble --lib campaign::statistics",
    },
    Mutant {
        name: "campaign: differences of unlike seeds",
        file: "crates/tumble/src/campaign/analysis.rs",
        original: "Some((*baseline_rows.get(k)?, *row))",
        replacement: "Some((*baseline_rows.values().next()?, *row)).filter(|_| baseline_rows.contains_key(k))",
        test: "-p tumble --lib campaign::",
    },
    Mutant {
        name: "mission motion: the stop brakes twice as hard",
        file: "crates/planning/src/mission/motion/arcs.rs",
        original: "braking.position[2] = ahead * (-0.5 * speed / moving_s);",
        replacement: "braking.position[2] = ahead * (-speed / moving_s);",
        test: "-p tumble-planning --lib mission::motion",
    },
    Mutant {
        name: "mission motion: turns of pieces are taken for exact",
        file: "crates/planning/src/mission/motion/contact.rs",
        original: "let apart_m = piece.apart_m + piece.apart_rad * reach_m;",
        replacement: "let apart_m = piece.apart_m - piece.apart_rad * reach_m;",
        test: "-p tumble-planning --test suite mission_motion::",
    },
    Mutant {
        name: "mission motion: the stop is not looked at",
        file: "crates/planning/src/mission/motion/contact.rs",
        original: "query.along_all(self.stop.arcs(), self.end_s)?",
        replacement: "query.along_all(self.stop.arcs(), self.rest_s)?",
        test: "-p tumble-planning --test suite mission_motion::",
    },
    Mutant {
        name: "mission motion: a table that does not bear",
        file: "crates/planning/src/mission/motion.rs",
        original: "Vector3::new(com.x, com.y, 0.0),",
        replacement: "com,",
        test: "-p tumble-planning --lib mission::motion",
    },
    Mutant {
        name: "mission motion: an arc's turn without its own bend",
        file: "crates/planning/src/mission/motion/held.rs",
        original: "h * h / 8.0 * (of_motion + of_arc)",
        replacement: "h * h / 16.0 * (of_motion + of_arc)",
        test: "-p tumble-planning --lib mission::motion",
    },
    Mutant {
        name: "flight estimator: the start is not learned again about a better body",
        file: "crates/identification/src/recursive/flight_estimator/first_lessons.rs",
        original: "filtered.about = Some(*about);",
        replacement: "filtered.about = Some(*about).filter(|_| false);",
        test: "-p tumble-identification --test suite flight_estimator::a_start_off_by_a_factor_of_two",
    },
    Mutant {
        name: "flight estimator: an all but impossible body is a certain one",
        file: "crates/identification/src/recursive/flight_estimator/filtered.rs",
        original: "if variance > LARGEST_LOG_EXTENT_VARIANCE {",
        replacement: "if variance > 1e9 * LARGEST_LOG_EXTENT_VARIANCE {",
        test: "-p tumble-identification --lib flight_estimator::tests",
    },
    Mutant {
        name: "flight estimator: a drift of the wrench keeps its covariance",
        file: "crates/identification/src/recursive/flight_estimator/flight_motion.rs",
        original: "*value *= left[j] * left_too;",
        replacement: "*value *= left_too;",
        test: "-p tumble-identification --lib flight_estimator::tests",
    },
    Mutant {
        name: "flight estimator: a force off its line leaves the products alone",
        file: "crates/identification/src/recursive/flight_estimator.rs",
        original: "[y + z, x + y, x + z, x + z, y + z, x + y]",
        replacement: "[y + z, 0.0, 0.0, x + z, 0.0, x + y]",
        test: "-p tumble-identification --lib flight_estimator::tests",
    },
    Mutant {
        name: "flight estimator: a late measurement is put last",
        file: "crates/identification/src/recursive/flight_estimator.rs",
        original: "moment.stamp_ns <= stamp_ns).max(1));",
        replacement: "moment.stamp_ns <= stamp_ns).max(self.moments.len()));",
        test: "-p tumble-identification --test suite flight_estimator::the_order_of_arrival",
    },
    Mutant {
        name: "flight estimator: a repeated measurement counts",
        file: "crates/identification/src/recursive/flight_estimator/filtered.rs",
        original: "let pose_moved = moved[0] || moved[1];",
        replacement: "let pose_moved = moved[0] || moved[1] || true;",
        test: "-p tumble-identification --test suite flight_estimator::a_frozen_sensor",
    },
    Mutant {
        name: "flight estimator: the body is learned from a map that moves",
        file: "crates/identification/src/recursive/flight_estimator/filtered.rs",
        original: "(false, _) => self.correct_all_but::<{ COORDINATES - BODY }>(rules, &step, &learned),",
        replacement: "(false, _) => self.correct(rules, &step, &learned),",
        test: "-p tumble-identification --test suite flight_estimator::a_map_that_moves_and_glides_back",
    },
    Mutant {
        name: "flight estimator: what was a motion of another body is as certain as ever",
        file: "crates/identification/src/recursive/flight_estimator/filtered.rs",
        original: "self.covariance[(i, i)] += variance;",
        replacement: "self.covariance[(i, i)] += 0.0 * variance;",
        test: "-p tumble-identification --test suite flight_estimator::a_grasp_at_arms_length",
    },
    Mutant {
        name: "flight estimator: first lessons go on from what was learned, however far off",
        file: "crates/identification/src/recursive/flight_estimator/first_lessons.rs",
        original: "if is_better { from_start.filtered } else { found.filtered }",
        replacement: "if is_better && false { from_start.filtered } else { found.filtered }",
        test: "-p tumble-identification --test suite flight_estimator::a_grasp_at_arms_length",
    },
    Mutant {
        name: "flight estimator: a body just made uncertain is doubted at once",
        file: "crates/identification/src/recursive/flight_estimator/health.rs",
        original: "Self { unacquainted_s: ACQUAINTANCE_S, learning_s: LEARNING_S, lessons_s: LAST_S, ..Self::default() }",
        replacement: "Self { learning_s: LEARNING_S - ACQUAINTANCE_S, lessons_s: LAST_S, ..Self::default() }",
        test: "-p tumble-identification --test suite flight_estimator::a_grasp_at_arms_length",
    },
    Mutant {
        name: "closed loop: doubted actuators are asked for the wrench itself",
        file: "crates/planning/src/mission/closed_loop.rs",
        original: "command.wrench_body = self.settings.brake.within(&asked);",
        replacement: "let _ = asked;",
        test: "-p tumble --test suite fault_campaign::a_nozzle",
    },
    Mutant {
        name: "closed loop: stops never get harder",
        file: "crates/planning/src/mission/closed_loop.rs",
        original: "acceleration_m_s2: acceleration_m_s2 * first_mass_kg / mass_kg,",
        replacement: "acceleration_m_s2: acceleration_m_s2 * f64::min(first_mass_kg / mass_kg, 1.0),",
        test: "-p tumble --test suite drawn_missions::stops_get_shorter",
    },
    Mutant {
        name: "closed loop: a refused stretch is flown",
        file: "crates/planning/src/mission/office.rs",
        original: "PlannerFault::Refused => refuse(&mut answer.found),",
        replacement: "PlannerFault::Refused => (),",
        test: "-p tumble-planning --test suite custom_robot::same_again",
    },
    Mutant {
        name: "stop limits: the easiest axis is braked",
        file: "crates/planning/src/mission/motion.rs",
        original: "heaviest.inertia_about_com().diagonal().max()",
        replacement: "heaviest.inertia_about_com().diagonal().min()",
        test: "-p tumble-planning --lib mission::motion::tests::a_stop_is_as_hard",
    },
    Mutant {
        name: "vague belief: the first moment does not know the mass",
        file: "crates/planning/src/belief.rs",
        original: "let covariance = scaled * scaled.transpose();",
        replacement: "let covariance = scaled.component_mul(&scaled);",
        test: "-p tumble-planning --lib belief::tests",
    },
    Mutant {
        name: "fly: draws nothing",
        file: "crates/tumble/src/cli/fly.rs",
        original: "if args.draw { draw_mission",
        replacement: "if args.json && !args.draw { draw_mission",
        test: "-p tumble --test suite campaign_command::the_command_of_a_row",
    },
    Mutant {
        name: "mission: planners have names of their own for the centre of mass",
        file: "crates/tumble/src/mission/flight.rs",
        original: "Some(axis) => format!(\"com_{axis}\"),",
        replacement: "Some(_) => quantity.to_owned(),",
        test: "-p tumble --test suite campaign_command::the_command_of_a_row",
    },
    Mutant {
        name: "mission: beliefs without numbers of their own",
        file: "crates/planning/src/mission/closed_loop.rs",
        original: "let revision = self.belief.revision + 1;",
        replacement: "let revision = 1;",
        test: "-p tumble --test suite fault_campaign::starts_anew",
    },
    Mutant {
        name: "mission: plans are flown however late they come",
        file: "crates/planning/src/mission/coordinator.rs",
        original: "let is_late = self.now_ns > stretch.start_ns || ",
        replacement: "let is_late = ",
        test: "-p tumble --test suite fault_campaign::expired",
    },
    Mutant {
        name: "mission: measurements go with the wrench of their arrival",
        file: "crates/tumble/src/mission/flight.rs",
        original: "of_pose(estimate.stamp_ns, &estimate.world_from_body,",
        replacement: "of_pose(estimate.arrival_ns, &estimate.world_from_body,",
        test: "-p tumble --test suite fault_campaign::a_second_late",
    },
    Mutant {
        name: "mission: a jump of the localisation is taken for a motion",
        file: "crates/identification/src/recursive/flight_estimator/filtered.rs",
        original: "let fits = rules.thresholds.lets_pass((nis, innovation.degrees_of_freedom));",
        replacement: "let fits = nis.is_finite();",
        test: "-p tumble --test suite fault_campaign::from_elsewhere",
    },
    Mutant {
        name: "mission: planners that do not answer are waited for",
        file: "crates/planning/src/mission/coordinator.rs",
        original: "self.now_ns > asked.start_ns.saturating_add(self.schedule.patience_ns)",
        replacement: "self.now_ns == i64::MAX && asked.request > 0",
        test: "-p tumble-planning --test suite coordinator::planners_that_never_answer",
    },
    Mutant {
        name: "mission: every stop is the gentle one",
        file: "crates/planning/src/mission/closed_loop.rs",
        original: "(!is_clear && !braking.is_soft)",
        replacement: "(is_clear && !braking.is_soft && time_s < 0.0)",
        test: "-p tumble --test suite fault_campaign::shows_up_late",
    },
    Mutant {
        name: "brake: the force turns the body",
        file: "crates/planning/src/mission/brake.rs",
        original: "Wrench::new(held + turn, force)",
        replacement: "Wrench::new(turn, force)",
        test: "-p tumble-planning --lib mission::brake",
    },
    Mutant {
        name: "brake: the origin is braked",
        file: "crates/planning/src/mission/brake.rs",
        original: "twist_body.linear + rate.cross(&center);",
        replacement: "twist_body.linear;",
        test: "-p tumble-planning --lib mission::brake",
    },
    Mutant {
        name: "mission: the body is blamed for its actuators",
        file: "crates/planning/src/mission/coordinator.rs",
        original: "if self.is_doubted_again() {\n            actions",
        replacement: "if self.is_doubted_again() && self.requests == u64::MAX {\n            actions",
        test: "-p tumble-planning --test suite coordinator::a_body_that_is_doubted_again",
    },
    Mutant {
        name: "mission: who stands too near must not leave",
        file: "crates/planning/src/mission/serve.rs",
        original: "let margin_m = held_m(settings.check_margin_m, distance_m);",
        replacement: "let margin_m = settings.check_margin_m;",
        test: "-p tumble --test suite fly_command::a_robot_that_stands_nearer",
    },
    Mutant {
        name: "coordinator: what no other body explains is never held against the thrust",
        file: "crates/planning/src/mission/coordinator.rs",
        original: "if self.is_doubted_again() {\n                    self.doubt_actuators(actions);",
        replacement: "if false {\n                    self.doubt_actuators(actions);",
        test: "-p tumble-planning --test suite coordinator::a_body_that_was_doubted_and",
    },
    Mutant {
        name: "flight estimator: a doubted wrench is believed",
        file: "crates/identification/src/recursive/flight_estimator/filtered.rs",
        original: "self.wrench_is_doubtful = true;",
        replacement: "self.wrench_is_doubtful = false;",
        test: "-p tumble-identification --test suite flight_estimator::a_lost_nozzle",
    },
    Mutant {
        name: "arm: bodies on fixed joints left at the joint's origin",
        file: "crates/formats/src/arm/assembly.rs",
        original: "+ body.transformed_by(&origin)",
        replacement: "+ body",
        test: "-p tumble --test suite arms::",
    },
    Mutant {
        name: "arm: the last of the joints that may come first",
        file: "crates/formats/src/arm/assembly.rs",
        original: "ready.pop_first()",
        replacement: "ready.pop_last()",
        test: "-p tumble --test suite arms::",
    },
    Mutant {
        name: "arm: roll and yaw of a URDF swapped",
        file: "crates/formats/src/arm/urdf.rs",
        original: "EulerZyx::new(roll, pitch, yaw)",
        replacement: "EulerZyx::new(yaw, pitch, roll)",
        test: "-p tumble --test suite arms::",
    },
    Mutant {
        name: "joint log: velocity of the base turned the wrong way",
        file: "crates/formats/src/log/joints.rs",
        original: "rotation.inverse() * self.base_velocity_world?",
        replacement: "rotation * self.base_velocity_world?",
        test: "-p tumble-formats --test suite joint_log::",
    },
    Mutant {
        name: "trees: lever of the base turned round",
        file: "crates/dynamics/src/multibody/kinematics.rs",
        original: "copy_from(&-skew(&point))",
        replacement: "copy_from(&skew(&point))",
        test: "-p tumble-dynamics --lib golden",
    },
    Mutant {
        name: "trees: no Coriolis acceleration of a slide",
        file: "crates/dynamics/src/multibody/inverse_dynamics.rs",
        original: "carried_rate.cross(&(along + along))",
        replacement: "carried_rate.cross(&along)",
        test: "-p tumble-dynamics --features testing --test suite multibody::every_tree",
    },
    Mutant {
        name: "trees: force of a link not carried to its parent's origin",
        file: "crates/dynamics/src/multibody/inverse_dynamics.rs",
        original: "rotation * wrench.torque + offset.cross(&force)",
        replacement: "rotation * wrench.torque",
        test: "-p tumble-dynamics --lib golden",
    },
    Mutant {
        name: "trees: rotor left out of forward dynamics",
        file: "crates/dynamics/src/multibody/forward_dynamics.rs",
        original: "inverse: T::one() / (own + link.joint.rotor_inertia)",
        replacement: "inverse: T::one() / own",
        test: "-p tumble-dynamics --features testing --test suite multibody::every_tree",
    },
    Mutant {
        name: "trees: bias of a joint's surplus lost",
        file: "crates/dynamics/src/multibody/forward_dynamics.rs",
        original: "surplus: force - bias",
        replacement: "surplus: force",
        test: "-p tumble-dynamics --lib golden",
    },
    Mutant {
        name: "trees: parallel axes halved",
        file: "crates/dynamics/src/multibody/mass_matrix.rs",
        original: "half.dot(p) * real(2.0)",
        replacement: "half.dot(p)",
        test: "-p tumble-dynamics --lib golden",
    },
    Mutant {
        name: "trees: products of inertia swapped in the regressor",
        file: "crates/dynamics/src/multibody/regressor.rs",
        original: "        Vector3::new(w.y, w.x, o),\n        Vector3::new(w.z, o, w.x),",
        replacement: "        Vector3::new(w.z, o, w.x),\n        Vector3::new(w.y, w.x, o),",
        test: "-p tumble-dynamics --lib golden",
    },
    Mutant {
        name: "trees: noise of the regressor ignored",
        file: "crates/identification/src/multibody/momentum_rows.rs",
        original: "if at_fitted_velocity { velocity - correction }",
        replacement: "if at_fitted_velocity { velocity }",
        test: "-p tumble-identification --lib noise_in_the_regressor",
    },
    Mutant {
        name: "local fit: windows reach across gaps",
        file: "crates/identification/src/multibody/local_fit.rs",
        original: "> GAP * step_s",
        replacement: "> 1e9 * step_s",
        test: "-p tumble-identification --lib multibody",
    },
    Mutant {
        name: "local fit: what a window flattens costs nothing",
        file: "crates/identification/src/multibody/local_fit.rs",
        original: "(flattened + passed / windows",
        replacement: "(passed / windows",
        test: "-p tumble-identification --lib multibody",
    },
    Mutant {
        name: "local fit: rows taken as equally spaced",
        file: "crates/identification/src/multibody/local_fit.rs",
        original: "(time_s - self.times_s[centre]) / self.step_s).collect()",
        replacement: "((time_s - self.times_s[centre]) / self.step_s).round()).collect()",
        test: "-p tumble-identification --lib multibody",
    },
];

/// A test that runs this long caught the change too: it does not end any more.
const PATIENCE: Duration = Duration::from_secs(600);

pub fn main(arguments: &[String]) -> ExitCode {
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["--list"] => {
            for mutant in MUTANTS {
                println!("{:<52} {}: cargo test {}", mutant.name, mutant.file, mutant.test);
            }
            ExitCode::SUCCESS
        }
        [] => exit_code(run("")),
        ["--only", part] => exit_code(run(part)),
        _ => {
            eprintln!("cargo xtask mutants [--only TEXT] [--list]");
            ExitCode::from(2)
        }
    }
}

fn exit_code<E: Display>(result: Result<bool, E>) -> ExitCode {
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Fate {
    Killed,
    Survived,
    /// The original text no longer occurs exactly once.
    Stale,
    /// The changed source does not compile, so no test judged it.
    DoesNotBuild,
    /// The test fails without the change.
    TestAlreadyFails,
}

/// Tries every mutant whose name holds `part`; true where all were killed.
pub fn run(part: &str) -> Result<bool, Box<dyn std::error::Error>> {
    let chosen: Vec<&Mutant> = MUTANTS.iter().filter(|mutant| mutant.name.contains(part)).collect();
    if chosen.is_empty() {
        return Err(format!("no mutant's name holds `{part}`").into());
    }
    let copy = target_dir().join("mutants/tree");
    synchronise(&root(), &copy)?;

    let mut baselines: Vec<(&str, bool)> = Vec::new();
    let mut fates = Vec::new();
    for mutant in chosen {
        let known = baselines.iter().find(|(test, _)| *test == mutant.test).map(|(_, passes)| *passes);
        let passes = if let Some(passes) = known {
            passes
        } else {
            let passes = cargo_test(&copy, mutant.test, Phase::Run)?;
            baselines.push((mutant.test, passes));
            passes
        };
        let start = Instant::now();
        let fate = if passes { try_mutant(mutant, &copy)? } else { Fate::TestAlreadyFails };
        println!("{:<52} {fate:?} ({:.0} s)", mutant.name, start.elapsed().as_secs_f64());
        fates.push((mutant, fate));
    }

    let killed = fates.iter().filter(|(_, fate)| *fate == Fate::Killed).count();
    println!("\n{killed} of {} killed", fates.len());
    for (mutant, fate) in fates.iter().filter(|(_, fate)| *fate != Fate::Killed) {
        println!("{fate:?}: {} in {}, cargo test {}", mutant.name, mutant.file, mutant.test);
    }
    Ok(killed == fates.len())
}

fn try_mutant(mutant: &Mutant, copy: &Path) -> Result<Fate, Box<dyn std::error::Error>> {
    let path = copy.join(mutant.file);
    let original = fs::read_to_string(&path).unwrap_or_default();
    let Some(changed) = apply(&original, mutant.original, mutant.replacement) else { return Ok(Fate::Stale) };
    fs::write(&path, changed)?;
    let fate = if !cargo_test(copy, mutant.test, Phase::Build)? {
        Fate::DoesNotBuild
    } else if cargo_test(copy, mutant.test, Phase::Run)? {
        Fate::Survived
    } else {
        Fate::Killed
    };
    fs::write(&path, original)?;
    Ok(fate)
}

/// The text with its one occurrence replaced.
fn apply(text: &str, original: &str, replacement: &str) -> Option<String> {
    (text.matches(original).count() == 1 && original != replacement).then(|| text.replacen(original, replacement, 1))
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Phase {
    Build,
    Run,
}

/// Whether `cargo test` succeeds in the copy.
fn cargo_test(copy: &Path, test: &str, phase: Phase) -> std::io::Result<bool> {
    let mut command = cargo("test --quiet");
    command.current_dir(copy).args(test.split_whitespace());
    if phase == Phase::Build {
        command.arg("--no-run");
    }
    command.env("CARGO_TARGET_DIR", target_dir().join("mutants/target"));
    // A killed mutant would leave proptest's failing case behind, and the next run would find it first.
    command.env("PROPTEST_FAILURE_PERSISTENCE", "off");
    let child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn()?;
    if phase == Phase::Build { within(child, Duration::MAX) } else { within(child, PATIENCE) }
}

/// Whether the child ends well, and in time.
fn within(mut child: Child, patience: Duration) -> std::io::Result<bool> {
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(status.success());
        }
        if start.elapsed() > patience {
            child.kill()?;
            child.wait()?;
            return Ok(false);
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Makes the copy equal to the checkout; files that are equal keep their time stamps, so cargo builds only what changed.
fn synchronise(from: &Path, to: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let wanted = tidy::repository_files(from)?;
    if to.exists() {
        for path in tidy::repository_files(to)? {
            if !wanted.contains(&path) {
                fs::remove_file(to.join(path))?;
            }
        }
    }
    for path in wanted {
        let Ok(bytes) = fs::read(from.join(&path)) else { continue };
        let target = to.join(path);
        if fs::read(&target).ok().as_ref() != Some(&bytes) {
            if let Some(folder) = target.parent() {
                fs::create_dir_all(folder)?;
            }
            fs::write(target, bytes)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_planted_change_still_applies() {
        let applies = |mutant: &&Mutant| {
            let text = fs::read_to_string(root().join(mutant.file)).unwrap_or_default();
            apply(&text, mutant.original, mutant.replacement).is_some()
        };
        let stale: Vec<&str> = MUTANTS.iter().filter(|mutant| !applies(mutant)).map(|mutant| mutant.name).collect();
        assert!(stale.is_empty(), "{stale:#?}");
    }

    #[test]
    fn names_are_unique() {
        for (index, mutant) in MUTANTS.iter().enumerate() {
            assert!(MUTANTS[..index].iter().all(|other| other.name != mutant.name), "{}", mutant.name);
        }
    }

    #[test]
    fn only_a_single_occurrence_is_replaced() {
        assert_eq!(apply("a + b", "+", "-"), Some("a - b".to_owned()));
        assert_eq!(apply("a + b + c", "+", "-"), None);
        assert_eq!(apply("a + b", "*", "-"), None);
        assert_eq!(apply("a + b", "+", "+"), None);
    }

    #[test]
    fn a_test_that_does_not_end_is_stopped() {
        let child = cargo("--version").stdout(Stdio::null()).spawn().unwrap();
        assert!(within(child, Duration::from_secs(60)).unwrap());
        let child = std::process::Command::new("sleep").arg("60").spawn().unwrap();
        assert!(!within(child, Duration::from_millis(100)).unwrap());
    }

    #[test]
    fn the_copy_follows_the_checkout() {
        let base = std::env::temp_dir().join(format!("tumble-mutants-{}", std::process::id()));
        let (from, to) = (base.join("from"), base.join("to"));
        fs::create_dir_all(from.join("src")).unwrap();
        fs::write(from.join("src/a.rs"), "a").unwrap();
        fs::write(from.join("src/b.rs"), "b").unwrap();
        synchronise(&from, &to).unwrap();
        let written = fs::metadata(to.join("src/a.rs")).unwrap().modified().unwrap();
        fs::remove_file(from.join("src/b.rs")).unwrap();
        fs::write(from.join("c.rs"), "c").unwrap();
        synchronise(&from, &to).unwrap();
        assert!(!to.join("src/b.rs").exists() && to.join("c.rs").exists());
        assert_eq!(fs::metadata(to.join("src/a.rs")).unwrap().modified().unwrap(), written);
        fs::remove_dir_all(base).unwrap();
    }
}
