//! The last motion that an estimator told, carried on where it tells none.

use tumble_dynamics::{
    Environment, FreeFlyer, FreeFlyerIn, InertialParameters, Integrator, MuntheKaas4, RigidBodyState,
};
use tumble_identification::estimator::Acted;

/// How the robot moves, as far as it was told.
#[derive(Clone, Copy, Debug)]
pub(super) struct LastMotion {
    state: RigidBodyState<f64>,
    /// When it moved so, ns.
    at_ns: i64,
    /// When the estimator last told a motion, ns.
    told_ns: i64,
}

impl LastMotion {
    pub(super) fn told(state: RigidBodyState<f64>, time_ns: i64) -> Self {
        Self { state, at_ns: time_ns, told_ns: time_ns }
    }

    /// Time since the estimator told a motion, ns.
    pub(super) fn age_ns(&self, time_ns: i64) -> i64 {
        time_ns - self.told_ns
    }

    /// The motion at the end of what acted, by the body that is believed in: a stop that nobody sees ends all the same.
    #[must_use]
    pub(super) fn carried_on(&self, acted: &Acted, body: &InertialParameters<f64>, environment: &Environment) -> Self {
        let span_ns = acted.until_ns - self.at_ns;
        if span_ns <= 0 {
            return *self;
        }
        let body = FreeFlyerIn { body: FreeFlyer::new(*body), environment };
        let (start_s, span_s) = (self.at_ns as f64 * 1e-9, span_ns as f64 * 1e-9);
        let state = MuntheKaas4.step(&body, &self.state, &acted.wrench_body, start_s, span_s);
        Self { state: state.unwrap_or(self.state), at_ns: acted.until_ns, ..*self }
    }

    pub(super) fn state(&self) -> RigidBodyState<f64> {
        self.state
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use tumble_dynamics::StoredMomentum;
    use tumble_lie::Wrench;

    #[test]
    fn a_push_against_the_motion_ends_it_and_what_is_no_wrench_changes_nothing() {
        let body = InertialParameters::solid_box(10.0, [0.3; 3]);
        let mut state = RigidBodyState::at_rest();
        state.twist_body.linear = Vector3::x() * 0.1;
        let push = |force: f64| Acted {
            from_ns: 0,
            until_ns: 1_000_000_000,
            wrench_body: Wrench::new(Vector3::zeros(), Vector3::x() * force),
            stored_body: Vector3::zeros(),
        };
        let (told, still) = (LastMotion::told(state, 0), Environment::default());
        let stopped = told.carried_on(&push(-1.0), &body, &still);
        assert!(stopped.state().twist_body.linear.norm() < 1e-12);
        assert!((stopped.state().world_from_body.translation.vector.x - 0.05).abs() < 1e-12);
        assert_eq!(
            (stopped.age_ns(1_000_000_000), stopped.carried_on(&push(-1.0), &body, &still).state()),
            (1_000_000_000, stopped.state())
        );
        assert_eq!(told.carried_on(&push(f64::NAN), &body, &still).state(), state);
    }

    /// Wheels that spin along z turn a turn about x into one about y.
    #[test]
    fn stored_momentum_turns_the_rate() {
        let body = InertialParameters::solid_box(10.0, [0.3; 3]);
        let mut state = RigidBodyState::at_rest();
        state.twist_body.angular = Vector3::x() * 0.1;
        let (wrench_body, momentum_body) = (Wrench::zero(), Vector3::z() * 0.5);
        let acted = Acted { from_ns: 0, until_ns: 20_000_000, wrench_body, stored_body: momentum_body };
        let wheels = Environment::default().with(StoredMomentum { momentum_body });
        let rate = LastMotion::told(state, 0).carried_on(&acted, &body, &wheels).state().twist_body.angular;
        let angle: f64 = 0.02 * 0.5 / body.inertia_about_com()[(0, 0)];
        assert!((rate - Vector3::new(angle.cos(), angle.sin(), 0.0) * 0.1).norm() < 1e-6, "{rate:?}, {angle}");
    }
}
