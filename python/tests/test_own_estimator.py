"""An estimator of one's own in `identify`, and what of it is refused."""

import unittest

import numpy as np

import tumble
from test_identify import WithLog


class LeastSquares:
    """Rows whitened by their own residuals."""

    name = "my-least-squares"

    def estimate(self, problem):
        rows, wrench = problem.regressor, problem.wrench
        weights = np.ones(6)
        for _ in range(3):
            a = (rows * weights[:, None]).reshape(-1, 10) * problem.magnitudes
            b = (wrench * weights).reshape(-1)
            scaled = np.linalg.lstsq(a, b, rcond=None)[0]
            residual = wrench - rows @ (scaled * problem.magnitudes)
            weights = 1 / residual.std(axis=0)
        scale = np.diag(problem.magnitudes)
        covariance = scale @ np.linalg.inv(a.T @ a) @ scale * problem.rows_alike
        return scaled * problem.magnitudes, (covariance + covariance.T) / 2


class Answering:
    """Whatever it is told."""

    def __init__(self, answer):
        self.answer = answer

    def estimate(self, problem):
        return self.answer(problem) if callable(self.answer) else self.answer


class OneOfMyOwn(WithLog):
    def test_it_answers_in_place_of_a_method(self):
        found = self.identify(estimator=LeastSquares())
        self.assertEqual(found.method, "my-least-squares")
        usual = self.identify()
        self.assertLess(abs(found.mass - usual.mass), 6 * found.sigma.mass)
        self.assertEqual(found.to_dict()["method"], "my-least-squares")
        of_file = tumble.identify_file(self.log, estimator=LeastSquares())
        self.assertEqual(of_file.to_json(), found.to_json())

    def test_it_is_told_the_record(self):
        seen = {}

        def look(problem):
            seen.update(problem.record, rows=problem.t, regressor=problem.regressor)
            return LeastSquares().estimate(problem)

        self.identify(estimator=Answering(look))
        self.assertTrue(np.allclose(seen["t"], self.t, rtol=0, atol=1e-9))
        self.assertTrue(np.array_equal(seen["position"], self.position))
        self.assertTrue(np.array_equal(seen["wrench"], self.wrench))
        self.assertTrue(np.allclose(seen["quaternion"], self.quaternion, atol=1e-6))
        self.assertTrue(np.isnan(seen["rate"]).all())
        self.assertEqual(seen["regressor"].shape, (len(seen["rows"]), 6, 10))

    def refused(self, words, answer):
        with self.assertRaises(tumble.TumbleError) as refused:
            self.identify(estimator=Answering(answer))
        self.assertEqual(refused.exception.code, "T015")
        self.assertIn("Answering", refused.exception.message)
        self.assertIn(words, refused.exception.message)
        return refused.exception

    def test_what_cannot_be_is_refused_with_its_name(self):
        good = tumble.parameters(10.0, [0.0, 0.0, 0.0], np.eye(3))
        doubt = np.eye(10) * 1e-4
        self.refused("`parameters`: number 3 is NaN", (np.where(np.arange(10) == 3, np.nan, good), doubt))
        self.refused("`covariance`: row 1, column 2 is inf", (good, np.where(np.arange(100).reshape(10, 10) == 12, np.inf, doubt)))
        self.refused("in place of (parameters, covariance)", good)
        self.refused("in place of (parameters, covariance)", None)
        self.refused("10 are needed", (good[:9], doubt))
        self.refused("(10, 10) is needed", (good, doubt[:9]))
        self.refused("covariance", (good, -doubt))
        self.refused("covariance", (good, np.zeros((10, 10))))
        self.refused("no body, mass", (-good, doubt))

    def test_an_exception_is_the_cause(self):
        def fails(problem):
            raise KeyError("no such thing")

        error = self.refused("KeyError", fails)
        self.assertIsInstance(error.__cause__, KeyError)

        def interrupted(problem):
            raise KeyboardInterrupt

        with self.assertRaises(KeyboardInterrupt):
            self.identify(estimator=Answering(interrupted))

    def test_what_is_no_estimator_and_what_it_would_not_heed(self):
        with self.assertRaisesRegex(tumble.TumbleError, "no method"):
            self.identify(estimator=object())
        with self.assertRaisesRegex(tumble.TumbleError, "`method` is nothing"):
            self.identify(estimator=LeastSquares(), method="ekf")


if __name__ == "__main__":
    unittest.main()
