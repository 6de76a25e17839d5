"""What the module costs: `measure.py PROGRAM WHEEL`, printed by `cargo xtask python`."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# Rounds of a measurement, of which the shortest counts.
ROUNDS = 5


def seconds(work):
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def shortest(work):
    return min(seconds(work) for _ in range(ROUNDS))


def run(words):
    subprocess.run(words, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def main():
    program, wheel = sys.argv[1:]
    def imported(modules):
        code = f"import time; start = time.perf_counter(); import {modules}; print(time.perf_counter() - start)"
        asked = [sys.executable, "-c", code]
        return min(float(subprocess.run(asked, check=True, capture_output=True).stdout) for _ in range(ROUNDS))

    print(f"wheel {os.path.getsize(wheel) / 1e6:.1f} MB")
    print(f"import tumble {imported('tumble'):.3f} s, with numpy, which its first array loads, {imported('tumble, numpy'):.3f} s")

    import tumble

    with tempfile.TemporaryDirectory() as folder:
        tumble.sample("log", folder)
        log = Path(folder) / "flight.csv"
        for method in ["auto", "ukf"]:
            there = shortest(lambda: run([program, "identify", str(log), "--json", "--method", method]))
            here = shortest(lambda: tumble.identify_file(log, method=method).to_json())
            print(f"identify, {method}: command line {there:.3f} s, Python {here:.3f} s, ratio {here / there:.2f}")


if __name__ == "__main__":
    main()
