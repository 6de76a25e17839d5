"""The estimator in flight, step by step."""

import unittest

import numpy as np

import tumble

BODY = tumble.parameters(10.0, [0.0, 0.0, 0.0], np.eye(3) * 0.2)
PRIOR = np.diag((0.3 * np.abs(BODY) + 0.05) ** 2)


def flown(mass, seconds=40.0, step=0.1):
    """A body of this mass pushed to and fro along x, and the estimator that looked on."""
    flying = tumble.FlightEstimator(BODY, PRIOR, period=step)
    noise = np.random.default_rng(1)
    position = velocity = 0.0
    for k in range(int(seconds / step)):
        force = 0.5 * np.sign(np.sin(0.8 * k * step))
        flying.acted(k * step, (k + 1) * step, [force, 0, 0, 0, 0, 0])
        position += velocity * step + force / mass * step**2 / 2
        velocity += force / mass * step
        received = flying.measured(
            (k + 1) * step,
            position=np.array([position, 0, 0]) + 1e-3 * noise.standard_normal(3),
            quaternion=[0, 0, 0, 1],
        )
        assert received.kind in ("used", "gated"), received
    return flying, position, velocity


class InFlight(unittest.TestCase):
    def test_a_mass_is_learned(self):
        flying, position, velocity = flown(12.0)
        belief = flying.belief()
        self.assertLess(abs(belief.mass - 12.0), 4 * belief.sigma.mass)
        self.assertLess(belief.sigma.mass, 0.2)
        self.assertEqual(belief.covariance.shape, (10, 10))
        state = flying.state(40.0)
        self.assertLess(abs(state["position"][0] - position), 5e-3)
        self.assertLess(abs(state["velocity"][0] - velocity), 5e-3)
        self.assertFalse(flying.health["diverged"])
        counts = flying.counts
        self.assertEqual(counts["used"] + counts["gated"], 400)

    def test_what_becomes_of_measurements(self):
        flying, *_ = flown(10.0, seconds=5.0)
        there = {"position": [0, 0, 0], "quaternion": [0, 0, 0, 1]}
        self.assertEqual(flying.measured(100.0, **there).kind, "from-the-future")
        self.assertEqual(flying.measured(5.0, **there).kind, "duplicate")
        self.assertEqual(flying.measured(0.15, **there).kind, "too-old")
        self.assertEqual(flying.measured(4.95, position=[1e9, 0, 0]).kind, "malformed")
        self.assertEqual(flying.measured(4.96).reason, "nothing was measured")

    def test_a_doubted_body_is_known_less(self):
        flying, *_ = flown(10.0)
        before = flying.belief().sigma.mass
        flying.doubt_body()
        self.assertGreater(flying.belief().sigma.mass, 2 * before)
        flying.restart(BODY, PRIOR)
        self.assertAlmostEqual(flying.belief().mass, 10.0, places=6)

    def test_what_is_refused(self):
        flying, *_ = flown(10.0, seconds=1.0)
        for call in [
            lambda: tumble.FlightEstimator(-BODY, PRIOR),
            lambda: tumble.FlightEstimator(BODY[:9], PRIOR),
            lambda: tumble.FlightEstimator(BODY, -PRIOR),
            lambda: tumble.FlightEstimator(BODY, PRIOR, period=0.0),
            lambda: tumble.FlightEstimator(BODY, PRIOR, position_noise=float("nan")),
            lambda: tumble.FlightEstimator(BODY, PRIOR, quaternion=[1, 1, 1, 1]),
            lambda: flying.acted(2.0, 1.0, [0] * 6),
            lambda: flying.acted(1.0, 2.0, [0] * 5),
            lambda: flying.measured(float("inf"), position=[0, 0, 0]),
            lambda: flying.measured(1.0, quaternion=[0, 0, 0, 3]),
            lambda: flying.restart(-BODY, PRIOR),
            lambda: tumble.parameters(-1.0, [0, 0, 0], np.eye(3)),
            lambda: tumble.parameters(1.0, [0, 0, 0], np.diag([1.0, 1.0, 5.0])),
        ]:
            with self.assertRaises(tumble.TumbleError):
                call()


if __name__ == "__main__":
    unittest.main()
