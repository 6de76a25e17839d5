//! Robots with payloads, drawn as thesis 4.5 says.

use nalgebra::{Matrix3, Vector3};
use tumble_dynamics::InertialParameters;
use tumble_identification::noise::Gaussian;

/// Bodies of the thesis's distribution that exist, and the share of its draws that do.
pub struct Loads {
    pub bodies: Vec<InertialParameters<f64>>,
    /// Share of draws that are bodies, the inertia taken about the centre of mass; of [`JUDGED`] draws.
    pub physical: f64,
    /// The same, the inertia taken about the body origin.
    pub physical_about_origin: f64,
}

/// Draws by which the share is judged.
pub const JUDGED: usize = 20_000;

/// The first `count` draws that are bodies; the inertia is about the centre of mass.
pub fn draw(count: usize, seed: u64) -> Loads {
    let mut random = Gaussian::from_seed(seed);
    let mut bodies = Vec::with_capacity(count);
    let mut physical = [0_usize; 2];
    let mut drawn = 0;
    while drawn < JUDGED || bodies.len() < count {
        let (mass, center, inertia) = one(&mut random);
        let exists = |body: InertialParameters<f64>| (mass > 0.0 && body.is_strictly_consistent()).then_some(body);
        let body = exists(InertialParameters::about_com(mass, center, inertia));
        if drawn < JUDGED {
            let about_origin = exists(InertialParameters::about_origin(mass, center, inertia));
            physical[0] += usize::from(body.is_some());
            physical[1] += usize::from(about_origin.is_some());
        }
        drawn += 1;
        bodies.extend(body.filter(|_| bodies.len() < count));
    }
    let share = |count: usize| count as f64 / JUDGED as f64;
    Loads { bodies, physical: share(physical[0]), physical_about_origin: share(physical[1]) }
}

/// Mass, centre of mass and inertia of one draw, whether or not such a body exists.
fn one(random: &mut Gaussian) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let mass = 7.2 + 0.5 * random.normal();
    let center = random.vector(0.04);
    let diagonal = random.vector(0.015).map(|deviation| 0.07 + deviation);
    let [xy, xz, yz] = random.vector(0.05).map(|deviation| 0.02 + deviation).into();
    let [xx, yy, zz] = diagonal.into();
    (mass, center, Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loads_are_bodies_and_few_draws_are() {
        let loads = draw(40, 2024);
        assert_eq!(loads.bodies.len(), 40);
        for body in &loads.bodies {
            assert!(body.is_strictly_consistent());
            // Triangle inequalities of the principal moments, by their own definition.
            let moments = body.inertia_about_com().symmetric_eigenvalues();
            assert!(moments.min() > 0.0 && moments.sum() > 2.0 * moments.max(), "{moments}");
        }
        // The independent prototype found 6.2 and 2.4 %; four standard errors of both counts of 20 000.
        assert!((loads.physical - 0.062).abs() < 0.01, "{}", loads.physical);
        assert!((loads.physical_about_origin - 0.024).abs() < 0.007, "{}", loads.physical_about_origin);
        assert_eq!(draw(3, 2024).bodies, loads.bodies[..3]);
    }

    #[test]
    fn draws_have_the_stated_moments() {
        let mut random = Gaussian::from_seed(5);
        let n = 20_000;
        let draws: Vec<_> = (0..n).map(|_| one(&mut random)).collect();
        let of = |value: usize| -> Vec<f64> {
            draws.iter().map(|(mass, center, j)| [*mass, center.y, j[(2, 2)], j[(2, 0)]][value]).collect()
        };
        for (value, [mean, deviation]) in [[7.2, 0.5], [0.0, 0.04], [0.07, 0.015], [0.02, 0.05]].into_iter().enumerate()
        {
            let values = of(value);
            let average = values.iter().sum::<f64>() / f64::from(n);
            let variance = values.iter().map(|x| (x - average).powi(2)).sum::<f64>() / f64::from(n);
            let found = [average, variance.sqrt()];
            // Four standard errors.
            let error = 4.0 * deviation / f64::from(n).sqrt();
            assert!((found[0] - mean).abs() < error && (found[1] - deviation).abs() < error, "{found:?} {mean}");
        }
    }
}
