"""What `identify` and `identify_file` answer is what the command line answers, to the bit."""

import json
import os
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np

import tumble

# The program to compare with, as `cargo xtask python` builds it.
PROGRAM = os.environ.get("TUMBLE_PROGRAM")


def columns(path):
    """Columns of a log by name."""
    with open(path, encoding="utf-8") as log:
        names = log.readline().strip().split(",")
        rows = np.array([[float(cell) if cell else np.nan for cell in line.strip().split(",")] for line in log])
    return {name: rows[:, at] for at, name in enumerate(names)}


def arrays(path):
    """The same as `identify` takes them."""
    log = columns(path)

    def stacked(names):
        return np.column_stack([log[name] for name in names.split()])

    return (
        log["t_s"],
        stacked("p_x p_y p_z"),
        stacked("q_x q_y q_z q_w"),
        stacked("f_x f_y f_z tau_x tau_y tau_z"),
    )


class WithLog(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.place = Path(cls.folder.name)
        tumble.sample("log", cls.place)
        cls.log, cls.truth = cls.place / "flight.csv", cls.place / "truth.toml"
        cls.t, cls.position, cls.quaternion, cls.wrench = arrays(cls.log)

    def identify(self, **keywords):
        return tumble.identify(self.t, self.position, self.quaternion, self.wrench, **keywords)


class TheAnswer(WithLog):
    def test_it_is_that_of_the_command_line_to_the_bit(self):
        if not PROGRAM:
            self.skipTest("TUMBLE_PROGRAM names no program to compare with; `cargo xtask python` builds one")
        tumble.sample("bag", self.place)
        asked = [
            (self.log, [], {}),
            (self.log, ["--reference", str(self.truth)], {"reference": self.truth}),
            (self.log, ["--method", "ekf"], {"method": "ekf"}),
            (self.log, ["--holdout"], {"holdout": 0.25}),
            (self.log, ["--method", "variational4", "--wrench", "sampled", "--gravity", "0,0,-1e-3"],
             {"method": "variational4", "wrench_timing": "sampled", "gravity": (0, 0, -1e-3)}),
            (self.place / "flight.bag", [], {}),
        ]
        for path, options, keywords in asked:
            with self.subTest(options=options, path=path.name):
                printed = subprocess.run([PROGRAM, "identify", str(path), "--json", *options], capture_output=True, text=True)
                self.assertIn(printed.returncode, (0, 3), printed.stderr)
                found = tumble.identify_file(path, **keywords)
                self.assertEqual(found.to_json() + "\n", printed.stdout)
                self.assertEqual(found.to_dict(), json.loads(printed.stdout))
                self.assertEqual(found.identified, printed.returncode == 0)

    def test_arrays_answer_as_their_file_does(self):
        of_file, of_arrays = tumble.identify_file(self.log), self.identify()
        self.assertEqual(of_file.to_json(), of_arrays.to_json())
        self.assertTrue(np.array_equal(of_file.covariance, of_arrays.covariance))

    def test_layouts_and_types_make_no_difference(self):
        expected = self.identify().to_json()
        others = [
            (np.asfortranarray(self.position), self.quaternion, self.wrench),
            (np.hstack([self.position, self.position])[:, :3], self.quaternion.tolist(), self.wrench[::-1][::-1]),
        ]
        for position, quaternion, wrench in others:
            self.assertEqual(tumble.identify(self.t, position, quaternion, wrench).to_json(), expected)
        nanoseconds = np.round(self.t * 1e9).astype(np.int64)
        self.assertEqual(tumble.identify(nanoseconds, self.position, self.quaternion, self.wrench).to_json(), expected)

    def test_it_is_the_body_that_flew(self):
        found = self.identify(reference=self.truth)
        self.assertEqual((found.verdict, found.identified, found.not_determined), ("identified", True, []))
        told = found.to_dict()
        self.assertEqual((found.mass, found.method, found.warnings), (told["mass_kg"], told["method"], told["warnings"]))
        self.assertEqual(found.center_of_mass.tolist(), told["com_m"])
        self.assertEqual(found.inertia.tolist(), told["inertia_about_com_kg_m2"])
        self.assertEqual(found.sigma.mass, told["std"]["mass_kg"])
        self.assertEqual(found.sigma.center_of_mass.tolist(), told["std"]["com_m"])
        self.assertEqual(found.sigma.inertia.tolist(), told["std"]["inertia_about_com_kg_m2"])
        self.assertLess(max(map(abs, told["reference"]["error_over_sigma"])), 5)
        self.assertEqual(found.covariance.shape, (10, 10))
        self.assertAlmostEqual(found.covariance[0, 0] ** 0.5, found.sigma.mass, places=12)
        again = tumble.parameters(found.mass, found.center_of_mass, found.inertia)
        self.assertTrue(np.allclose(again, found.parameters, rtol=1e-12, atol=1e-14))
        residuals = found.residuals
        self.assertEqual(residuals["force"].shape, (len(residuals["t"]), 3))
        self.assertIn("verdict: all ten parameters identified", found.table())

    def test_what_a_log_does_not_tell_is_not_a_number(self):
        still = np.zeros_like(self.position)
        upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(self.t), 1))
        pushed = np.zeros_like(self.wrench)
        pushed[:, 0] = 0.1 * np.sin(self.t)
        still[:, 0] = -0.01 * np.sin(self.t)
        found = tumble.identify(self.t, still, upright, pushed)
        self.assertFalse(found.identified)
        self.assertTrue(found.not_determined)
        self.assertIsNone(found.covariance)
        self.assertTrue(np.isnan(found.inertia).any())
        with self.assertRaises(tumble.TumbleError) as refused:
            found.export(self.place / "nothing.toml")
        self.assertEqual(refused.exception.code, "T014")

    def test_rows_of_nan_were_not_measured(self):
        position = self.position.copy()
        position[1::2] = np.nan
        rate = np.full_like(position, np.nan)
        found = tumble.identify(self.t, position, self.quaternion, self.wrench, rate=rate)
        self.assertLess(abs(found.mass - self.identify().mass), 5 * found.sigma.mass)

    def test_the_body_is_exported(self):
        found = self.identify()
        for name in ["body.toml", "body.urdf", "body.json", "body.xml"]:
            found.export(self.place / name)
            self.assertGreater((self.place / name).stat().st_size, 100)
        with self.assertRaises(tumble.TumbleError) as refused:
            found.export(self.place / "body.toml")
        self.assertEqual(refused.exception.code, "T010")
        found.export(self.place / "body.toml", force=True)
        as_reference = self.identify(reference=self.place / "body.toml").to_dict()["reference"]["error_over_sigma"]
        self.assertLess(max(map(abs, as_reference)), 1e-6)

    def test_a_figure_or_a_reason(self):
        found = self.identify()
        try:
            import matplotlib  # noqa: F401
        except ImportError:
            with self.assertRaisesRegex(tumble.TumbleError, "matplotlib"):
                found.plot()
            return
        figure = found.plot()
        figure.savefig(self.place / "found.png")
        self.assertGreater((self.place / "found.png").stat().st_size, 10_000)


class WhatIsRefused(WithLog):
    def refused(self, words, *arguments, code="T014", **keywords):
        given = {"t": self.t, "position": self.position, "quaternion": self.quaternion, "wrench": self.wrench}
        given.update(keywords)
        with self.assertRaises(tumble.TumbleError) as refused:
            tumble.identify(**given)
        error = refused.exception
        self.assertEqual(error.code, code, error)
        self.assertIn(words, error.message)
        self.assertIn(error.remedy, str(error))
        self.assertTrue(error.remedy)

    def test_by_argument_and_row(self):
        def broken(array, at, value):
            array = array.copy()
            array[at] = value
            return array

        self.refused("`position` has the shape", position=self.position[:-1])
        self.refused("`wrench` has the shape", wrench=self.wrench[:, :3])
        self.refused("`quaternion`, row 7: its norm", quaternion=broken(self.quaternion, 7, [1.0, 1.0, 0.0, 0.0]))
        self.refused("`position`, row 3: number 1 is inf", position=broken(self.position, (3, 1), np.inf))
        self.refused("`wrench`, row 3: number 2 is NaN", wrench=broken(self.wrench, (3, 2), np.nan))
        self.refused("`t`, row 5", t=broken(self.t, 5, np.nan))
        self.refused("nanoseconds", t=np.arange(len(self.t)))
        self.refused("", t=self.t[::-1], code="T015")
        self.refused("", t=np.zeros_like(self.t), code="T015")
        nothing = {"t": [], "position": np.zeros((0, 3)), "quaternion": np.zeros((0, 4)), "wrench": np.zeros((0, 6))}
        self.refused("`t` has no rows", **nothing)

    def test_options(self):
        self.refused("invalid value 'magic'", method="magic")
        self.refused("share kept back", holdout=1.5)
        self.refused("can be estimated", estimate=["colour"])
        with self.assertRaises(tumble.TumbleError) as refused:
            tumble.identify_file(self.place / "nowhere.csv")
        self.assertEqual(refused.exception.code, "T001")
        with self.assertRaises(TypeError):
            self.identify(colour="red")
        with self.assertRaises((TypeError, ValueError)):
            tumble.identify("abc", self.position, self.quaternion, self.wrench)

    def test_a_path_that_looks_like_an_option_is_a_path(self):
        with self.assertRaises(tumble.TumbleError) as refused:
            tumble.identify_file("--demo")
        self.assertEqual(refused.exception.code, "T001")


class OtherThreads(WithLog):
    def test_they_run_meanwhile(self):
        counted, is_over = [0], threading.Event()

        def count():
            while not is_over.is_set():
                counted[0] += 1
                time.sleep(0.001)

        thread = threading.Thread(target=count)
        thread.start()
        start = time.perf_counter()
        self.identify(method="ukf")
        took = time.perf_counter() - start
        seen = counted[0]
        is_over.set()
        thread.join()
        # A count a millisecond; a hundredth of that is enough to tell that the interpreter was free.
        self.assertGreater(seen, took * 10)


if __name__ == "__main__":
    unittest.main()
