//! Likelihood of state-space models: against dense algebra, and on simulated flights with known answers.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use rand_chacha::ChaCha8Rng;
use rand_core::{Rng, SeedableRng};
use tumble_identification::IdentificationError;
use tumble_identification::nalgebra::{DMatrix, DVector, Matrix1, Matrix2, SMatrix, SVector};
use tumble_identification::state_space::{
    AugmentedKalmanFilter, Evidence, LikelihoodMaximum, Parameter, Signal, maximize_likelihood,
};

struct Normal(ChaCha8Rng);

impl Normal {
    fn seeded(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Sum of twelve uniforms.
    fn next(&mut self) -> f64 {
        (0..12).map(|_| f64::from(self.0.next_u32()) / 4_294_967_296.0).sum::<f64>() - 6.0
    }
}

const POSITION: SMatrix<f64, 1, 2> = SMatrix::<f64, 1, 2>::new(1.0, 0.0);

fn relative(found: f64, wanted: f64) -> f64 {
    (found - wanted).abs() / wanted.abs().max(1.0)
}

/// Twelve positions of a mass point with two unknown forces and an unknown start, written out as one Gaussian vector.
#[test]
fn the_likelihood_is_that_of_the_whole_gaussian_vector() {
    const STEPS: usize = 12;
    let (h, walk, sigma) = (0.3, 0.7, 0.2);
    let transition = Matrix2::new(1.0, h, 0.0, 0.9);
    let noise = Matrix2::new(h * h * h / 3.0, h * h / 2.0, h * h / 2.0, h) * walk;
    let input = |k: usize| {
        SMatrix::<f64, 2, 5>::new(
            0.0,
            0.0,
            0.0,
            0.1 * (k as f64).sin(),
            0.02, //
            -0.3,
            0.0,
            0.0,
            (k as f64).sin(),
            (0.7 * k as f64).cos(),
        )
    };
    let direct = SMatrix::<f64, 1, 5>::new(0.1, 0.0, 0.0, 0.0, 0.4);
    let initial = SMatrix::<f64, 2, 5>::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0);
    let mut normal = Normal::seeded(3);
    let positions: Vec<f64> = (0..STEPS).map(|k| (k as f64).sqrt() + normal.next()).collect();

    let mut filter = AugmentedKalmanFilter::new(initial, Matrix2::identity() * 0.05);
    for (k, position) in positions.iter().enumerate() {
        if k > 0 {
            filter.predict(&transition, &input(k), &noise);
        }
        filter.measure_through(&POSITION, &direct, *position, sigma * sigma).unwrap();
    }
    let found = filter.evidence().solve().unwrap();

    // Response of every state to start, inputs and noises, then the positions' mean and covariance.
    let mut columns = vec![initial];
    let mut from = vec![Matrix2::identity()];
    for k in 1..STEPS {
        columns.push(transition * columns[k - 1] + input(k));
        from.push(transition * from[k - 1]);
    }
    let covariance = DMatrix::from_fn(STEPS, STEPS, |i, j| {
        let mut state = from[i] * Matrix2::identity() * 0.05 * from[j].transpose();
        for k in 1..=i.min(j) {
            state += from[i - k] * noise * from[j - k].transpose();
        }
        state[(0, 0)] + if i == j { sigma * sigma } else { 0.0 }
    });
    let regressor = DMatrix::from_fn(STEPS, 4, |i, j| columns[i][(0, j + 1)] + direct[j + 1]);
    let output = DVector::from_fn(STEPS, |i, _| positions[i] - columns[i][(0, 0)] - direct[0]);
    let inverse = covariance.clone().try_inverse().unwrap();
    let information = regressor.transpose() * &inverse * &regressor;
    let value = information.clone().try_inverse().unwrap() * regressor.transpose() * &inverse * &output;
    let residual = &output - &regressor * &value;
    let square = (residual.transpose() * &inverse * &residual)[0];
    let log_likelihood = -0.5
        * ((STEPS - 4) as f64 * std::f64::consts::TAU.ln()
            + covariance.determinant().ln()
            + information.determinant().ln()
            + square);
    assert!((&found.value - &value).amax() < 1e-10, "{} against {value}", found.value);
    assert!((&found.covariance - information.try_inverse().unwrap()).amax() < 1e-10);
    assert!(relative(found.log_likelihood, log_likelihood) < 1e-11, "{} {log_likelihood}", found.log_likelihood);
    assert!(relative(found.squared_innovations, square) < 1e-11);
    assert_eq!(found.degrees_of_freedom, STEPS - 4);
}

#[test]
fn evidence_adds_up_and_takes_what_is_known() {
    let mut filter = AugmentedKalmanFilter::<1, 2>::new(SMatrix::<f64, 1, 2>::new(0.0, 1.0), Matrix1::zeros());
    filter.measure(&Matrix1::new(1.0), 3.0, 0.5).unwrap();
    let mut evidence = *filter.evidence();
    evidence += filter.evidence();
    evidence.know(0, 7.0, 0.5).unwrap();
    let found = evidence.solve().unwrap();
    // Variances 1/2, 1/2, 1/4.
    assert!(relative(found.value[0], (2.0 * 3.0 + 2.0 * 3.0 + 4.0 * 7.0) / 8.0) < 1e-14);
    assert!(relative(found.covariance[(0, 0)], 1.0 / 8.0) < 1e-14);
}

#[test]
fn what_is_open_or_impossible_is_refused() {
    let open = Evidence::<3>::default().solve().unwrap_err();
    assert!(matches!(open, IdentificationError::NotExcited { rank: 0, expected: 2, .. }), "{open}");
    assert!(Evidence::<2>::default().know(1, 0.0, 1.0).is_err());
    assert!(Evidence::<2>::default().know(0, 0.0, 0.0).is_err());
    let mut filter = AugmentedKalmanFilter::<1, 1>::new(Matrix1::zeros(), Matrix1::zeros());
    assert!(filter.measure(&Matrix1::new(1.0), 0.0, 0.0).is_err());
    // A parameter the likelihood does not depend on.
    let flat = maximize_likelihood(&[Parameter { start: 0.0, scale: 1.0 }], |_| {
        let mut evidence = Evidence::<2>::default();
        evidence.know(0, 1.0, 1.0)?;
        Ok(evidence)
    });
    assert!(matches!(flat, Err(IdentificationError::NotExcited { .. })), "{flat:?}");
    let times = vec![0.0, 1.0, 1.0];
    assert!(Signal::try_new(times, vec![SVector::<f64, 1>::zeros(); 3]).is_err());
    assert!(Signal::try_new(vec![0.0], vec![SVector::<f64, 1>::zeros()]).is_err());
    let signal = Signal::try_new(vec![0.0, 1.0], vec![SVector::<f64, 1>::zeros(); 2]).unwrap();
    assert!(signal.lagged(0.0).is_err());
}

/// A ramp behind a lag: `y = t - lag (1 - exp(-t / lag))`, at uneven samples and between them.
#[test]
fn a_lag_is_exact_for_ramps_and_smooth_between_samples() {
    let times: Vec<f64> = (0..60).map(|k| 0.01 * f64::from(k) + 0.002 * f64::from(k % 3)).collect();
    let ramp = times.iter().map(|t| SVector::from([*t, -3.0])).collect();
    let lag = 0.07;
    let lagged = Signal::try_new(times.clone(), ramp).unwrap().lagged(lag).unwrap();
    let truth = |t: f64| t - lag * (1.0 - (-t / lag).exp());
    for pair in times.windows(2) {
        assert!((lagged.at(pair[0])[0] - truth(pair[0])).abs() < 1e-14);
        let between = 0.3 * pair[0] + 0.7 * pair[1];
        assert!((lagged.at(between)[0] - truth(between)).abs() < 1e-6);
        assert!((lagged.at(between)[1] + 3.0).abs() < 1e-14);
    }
    assert!(lagged.at(-1.0)[0].abs() < 1e-15);
}

const HOVER_STEP_S: f64 = 0.01;
const HOVER_DELAY_S: f64 = 0.023;
const GRAVITY: f64 = 9.81;
const MASS: f64 = 0.045;

fn thrust(time_s: f64) -> f64 {
    MASS * GRAVITY + 0.1 * ((7.0 * time_s).sin() + (3.1 * time_s + 1.0).sin() + (15.0 * time_s).cos())
}

/// Eight seconds up and down: `p'' = thrust(t - delay) / m - g + white force`, positions to a millimetre.
fn fit_hover(seed: u64, force: f64, sigma: f64) -> LikelihoodMaximum {
    const SUBSTEPS: usize = 10;
    let mut normal = Normal::seeded(seed);
    let (mut position, mut velocity) = (0.5, 0.1);
    let (mut times, mut positions) = (Vec::new(), Vec::new());
    for k in 0..800 {
        let time_s = HOVER_STEP_S * f64::from(k);
        times.push(time_s);
        positions.push(position + sigma * normal.next());
        let h = HOVER_STEP_S / SUBSTEPS as f64;
        for substep in 0..SUBSTEPS {
            let middle_s = time_s + (substep as f64 + 0.5) * h;
            let acceleration = thrust(middle_s - HOVER_DELAY_S) / MASS - GRAVITY + force * normal.next() / h.sqrt();
            position += h * velocity + 0.5 * h * h * acceleration;
            velocity += h * acceleration;
        }
    }
    let forces = times.iter().map(|time_s| SVector::from([thrust(*time_s)])).collect();
    let signal = Signal::try_new(times.clone(), forces).unwrap();
    let start = [(0.0, 0.002), (0.1_f64.ln(), 0.1), (3e-4_f64.ln(), 0.1)];
    maximize_likelihood(&start.map(|(start, scale)| Parameter { start, scale }), |at| {
        let h = HOVER_STEP_S;
        let initial = SMatrix::<f64, 2, 4>::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0);
        let mut filter = AugmentedKalmanFilter::new(initial, Matrix2::zeros());
        let acceleration = |time_s: f64| SMatrix::<f64, 1, 4>::new(-GRAVITY, 0.0, 0.0, signal.at(time_s - at[0])[0]);
        let walk = Matrix2::new(h * h * h / 3.0, h * h / 2.0, h * h / 2.0, h) * (2.0 * at[1]).exp();
        for (time_s, position) in times.iter().zip(&positions) {
            if *time_s > 0.0 {
                let (from, to) = (acceleration(time_s - h), acceleration(*time_s));
                let mut inputs = SMatrix::<f64, 2, 4>::zeros();
                inputs.set_row(0, &((from * 2.0 + to) * (h * h / 6.0)));
                inputs.set_row(1, &((from + to) * (0.5 * h)));
                filter.predict(&Matrix2::new(1.0, h, 0.0, 1.0), &inputs, &walk);
            }
            filter.measure(&POSITION, *position, (2.0 * at[2]).exp())?;
        }
        Ok(*filter.evidence())
    })
    .unwrap()
}

#[test]
fn nearly_noise_free_positions_give_mass_and_delay() {
    let found = fit_hover(1, 5e-3, 5e-5);
    assert!((1.0 / found.linear.value[2] / MASS - 1.0).abs() < 1e-3, "{}", 1.0 / found.linear.value[2]);
    assert!((found.parameters[0] - HOVER_DELAY_S).abs() < 2e-4, "{}", found.parameters[0]);
}

/// Over 120 flights the mean squared score of mass and of delay is one: within 1 +- 3.29 sqrt(2 / 120) at 99.9 %.
#[test]
fn errors_of_mass_and_delay_are_as_large_as_they_say() {
    const FLIGHTS: u64 = 120;
    let (force, sigma) = (0.08, 1e-3);
    let (mut mass, mut delay, mut noise) = (0.0, 0.0, [0.0; 2]);
    for seed in 0..FLIGHTS {
        let found = fit_hover(100 + seed, force, sigma);
        mass += (found.linear.value[2] - 1.0 / MASS).powi(2) / found.linear_covariance[(2, 2)];
        delay += (found.parameters[0] - HOVER_DELAY_S).powi(2) / found.parameter_covariance[(0, 0)];
        noise = [noise[0] + found.parameters[1], noise[1] + found.parameters[2]];
    }
    let count = FLIGHTS as f64;
    let half_width = 3.29 * (2.0 / count).sqrt();
    println!("mass {:.3}, delay {:.3}, band 1 +- {half_width:.3}", mass / count, delay / count);
    println!("force {:.4}, position {:.2e}", (noise[0] / count).exp(), (noise[1] / count).exp());
    assert!((mass / count - 1.0).abs() < half_width, "mass {:.3}", mass / count);
    assert!((delay / count - 1.0).abs() < half_width, "delay {:.3}", delay / count);
    assert!(((noise[0] / count).exp() / force - 1.0).abs() < 0.05);
    assert!(((noise[1] / count).exp() / sigma - 1.0).abs() < 0.02);
}

const TURN_STEP_S: f64 = 0.01;
const LAG_S: f64 = 0.06;
const INERTIA: f64 = 1.1e-5;

/// Ten seconds of rolling: `J dw = torque behind the lag + walking disturbance`; the lag estimated, or given.
fn fit_roll(seed: u64, walk: f64, given_lag_s: Option<f64>) -> LikelihoodMaximum {
    const SUBSTEPS: usize = 10;
    let mut normal = Normal::seeded(seed);
    let count = 1000;
    let times: Vec<f64> = (0..count).map(|k| TURN_STEP_S * f64::from(k)).collect();
    // Torque commands that jump to a new value now and then, linear between samples.
    let mut command = 0.0;
    let commands: Vec<f64> = (0..count)
        .map(|k| {
            if k % 15 == 0 {
                command = 3e-4 * normal.next();
            }
            command
        })
        .collect();
    let (mut rate, mut behind, mut disturbance) = (0.2, commands[0], 0.5);
    let mut rates = Vec::new();
    for k in 0..times.len() {
        rates.push(rate + 3e-3 * normal.next());
        let next = commands[(k + 1).min(commands.len() - 1)];
        let h = TURN_STEP_S / SUBSTEPS as f64;
        for substep in 0..SUBSTEPS {
            let share = (substep as f64 + 0.5) / SUBSTEPS as f64;
            let torque = commands[k] * (1.0 - share) + next * share;
            let before = behind;
            let kept = (-h / LAG_S).exp();
            behind = torque + (behind - torque) * kept;
            rate += h * (0.5 * (before + behind) / INERTIA + disturbance);
            disturbance += walk * h.sqrt() * normal.next();
        }
    }
    let signal =
        Signal::try_new(times.clone(), commands.iter().map(|command| SVector::from([*command])).collect()).unwrap();
    let mut parameters =
        vec![Parameter { start: walk.ln() + 0.3, scale: 0.1 }, Parameter { start: 4e-3_f64.ln(), scale: 0.05 }];
    if given_lag_s.is_none() {
        parameters.push(Parameter { start: 0.08_f64.ln(), scale: 0.03 });
    }
    maximize_likelihood(&parameters, |at| {
        let h = TURN_STEP_S;
        let lagged = signal.lagged(given_lag_s.unwrap_or_else(|| at[2].exp()))?;
        let initial = SMatrix::<f64, 2, 4>::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0);
        let mut filter = AugmentedKalmanFilter::new(initial, Matrix2::zeros());
        let noise = Matrix2::new(h * h * h / 3.0, h * h / 2.0, h * h / 2.0, h) * (2.0 * at[0]).exp();
        for (k, rate) in rates.iter().enumerate() {
            if k > 0 {
                let torque = |k: usize| lagged.at(times[k])[0];
                // Simpson: the middle by the cubic between samples.
                let middle = lagged.at(0.5 * (times[k - 1] + times[k]))[0];
                let impulse = (torque(k - 1) + 4.0 * middle + torque(k)) * (h / 6.0);
                let inputs = SMatrix::<f64, 2, 4>::new(0.0, 0.0, 0.0, impulse * 1e5, 0.0, 0.0, 0.0, 0.0);
                filter.predict(&Matrix2::new(1.0, h, 0.0, 1.0), &inputs, &noise);
            }
            filter.measure(&POSITION, *rate, (2.0 * at[1]).exp())?;
        }
        Ok(*filter.evidence())
    })
    .unwrap()
}

fn inertia(found: &LikelihoodMaximum) -> f64 {
    1e-5 / found.linear.value[2]
}

#[test]
fn a_wrong_lag_moves_the_inertia_and_the_estimated_one_does_not() {
    let joint = fit_roll(5, 3.0, None);
    let sigma = joint.linear_covariance[(2, 2)].sqrt() / joint.linear.value[2];
    println!("lag {:.4}, inertia {:.4e}, sigma {:.2} %", joint.parameters[2].exp(), inertia(&joint), 100.0 * sigma);
    assert!((inertia(&joint) / INERTIA - 1.0).abs() < 4.0 * sigma && sigma < 0.01);
    let [short, right, long] = [LAG_S - 0.008, LAG_S, LAG_S + 0.008].map(|lag_s| fit_roll(5, 3.0, Some(lag_s)));
    println!("{:.4e} {:.4e} {:.4e}", inertia(&short), inertia(&right), inertia(&long));
    assert!((inertia(&right) / INERTIA - 1.0).abs() < 4.0 * sigma);
    assert!(inertia(&short) > 1.05 * INERTIA, "eight milliseconds short: {:.3e}", inertia(&short));
    assert!(inertia(&long) < 0.95 * INERTIA, "eight milliseconds long: {:.3e}", inertia(&long));
    // What the lag leaves open is in the covariance: known, it would be smaller.
    assert!(joint.linear_covariance[(2, 2)] > 1.5 * joint.linear.covariance[(2, 2)]);
    for wrong in [short, long] {
        assert!(wrong.linear.log_likelihood < right.linear.log_likelihood - 10.0);
    }
}

/// As for the hovering flights: mean squared scores of inertia and lag over 120 flights.
#[test]
fn errors_of_inertia_and_lag_are_as_large_as_they_say() {
    const FLIGHTS: u64 = 120;
    let (mut inertia, mut lag) = (0.0, 0.0);
    for seed in 0..FLIGHTS {
        let found = fit_roll(1000 + seed, 3.0, None);
        inertia += (found.linear.value[2] - 1e-5 / INERTIA).powi(2) / found.linear_covariance[(2, 2)];
        lag += (found.parameters[2] - LAG_S.ln()).powi(2) / found.parameter_covariance[(2, 2)];
    }
    let count = FLIGHTS as f64;
    let half_width = 3.29 * (2.0 / count).sqrt();
    println!("inertia {:.3}, lag {:.3}, band 1 +- {half_width:.3}", inertia / count, lag / count);
    assert!((inertia / count - 1.0).abs() < half_width, "inertia {:.3}", inertia / count);
    assert!((lag / count - 1.0).abs() < half_width, "lag {:.3}", lag / count);
}
