"""Flights, missions, plans and excitations."""

import json
import os
import subprocess
import tempfile
import unittest
from pathlib import Path

import numpy as np

import tumble

PROGRAM = os.environ.get("TUMBLE_PROGRAM")
# What of a summary is the clock's.
TIMES = {"folder", "speed_over_real_time", "wall_s", "first_plan_wall_s", "design_s"}


class Commands(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.place = Path(cls.folder.name)

    def compare(self, run, *words):
        """With the object that the command line prints."""
        if not PROGRAM:
            return
        out = self.place / "-".join(words).replace("/", "-")
        printed = subprocess.run([PROGRAM, *words, "--json", "--out", str(out)], capture_output=True, text=True)
        told = {key: value for key, value in json.loads(printed.stdout).items() if key not in TIMES}
        self.assertEqual({key: value for key, value in run.summary.items() if key not in TIMES}, told)
        self.assertEqual(run.achieved, printed.returncode == 0)

    def test_simulate(self):
        run = tumble.simulate("iss-excite", seed=3, duration=20)
        self.assertEqual((run.summary["seed"], run.summary["duration_s"]), (3, 20))
        series = run.series
        self.assertEqual(run.summary["rows"], len(series["t_s"]))
        self.assertTrue(np.isfinite(series["true_p_x"]).all())
        run.save("log.csv", self.place / "simulated.csv")
        found = tumble.identify_file(self.place / "simulated.csv")
        self.assertTrue(np.isfinite(found.mass))
        self.compare(run, "simulate", "iss-excite", "--seed", "3", "--duration", "20")
        with self.assertRaisesRegex(tumble.TumbleError, "it wrote"):
            run.table("nothing.csv")
        with self.assertRaises(tumble.TumbleError):
            run.table("../secret.csv")

    def test_fly(self):
        run = tumble.fly("granite-cargo", seed=1)
        self.assertTrue(run.achieved, run.summary)
        self.assertTrue(run.summary["arrived"])
        run.report(self.place / "flight.html")
        self.assertIn("<html", (self.place / "flight.html").read_text(encoding="utf-8")[:2000])
        self.assertGreater(len(run.series["t_s"]), 100)
        self.compare(run, "fly", "granite-cargo", "--seed", "1")

    def test_plan(self):
        run = tumble.plan("iss-slalom", first=True)
        self.assertTrue(run.achieved)
        self.assertEqual(run.series["p_x"].shape, run.series["t_s"].shape)
        self.compare(run, "plan", "iss-slalom", "--first")

    def test_excite(self):
        run = tumble.excite(starts=1, cycles=3, fly=True, position=(0.5, 0.5, 0.2))
        self.assertIn("excitation.toml", run.files)
        self.assertEqual(len(run.series["t_s"]), 3000)
        self.assertIn("t_s", run.table("motion.csv"))
        self.compare(run, "excite", "--starts", "1", "--cycles", "3", "--fly", "--position", "0.5,0.5,0.2")

    def test_what_is_refused(self):
        for call, code in [
            (lambda: tumble.simulate("nowhere"), "T026"),
            (lambda: tumble.simulate("iss-excite", duration=-1), "T014"),
            (lambda: tumble.fly("iss-cargo", fault="nonsense"), "T014"),
            (lambda: tumble.excite(harmonics=1000), "T021"),
            (lambda: tumble.excite(period=float("nan")), "T014"),
            (lambda: tumble.sample("colour", self.place), "T014"),
        ]:
            with self.assertRaises(tumble.TumbleError) as refused:
                call()
            self.assertEqual(refused.exception.code, code, refused.exception)
        with self.assertRaises(OverflowError):
            tumble.fly(seed=-1)

    def test_nothing_is_left_behind(self):
        before = set(Path(tempfile.gettempdir()).glob("tumble-*"))
        run = tumble.plan("iss-slalom", first=True)
        during = set(Path(tempfile.gettempdir()).glob("tumble-*")) - before
        self.assertTrue(during)
        del run
        self.assertFalse({place for place in during if place.exists()})


if __name__ == "__main__":
    unittest.main()
