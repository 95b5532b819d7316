#!/usr/bin/env python3
"""A scheduler and two workers as processes of their own; one worker is killed while it fits. The
merge must hold every reading once and equal one partial fit of all readings to rounding.

    docs/scale/test.sh

Writes CSV and Parquet parts from one stream of random numbers, so that both kinds are read.
"""

import csv
import json
import math
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time

import pyarrow.csv
import pyarrow.parquet
from dask.distributed import Client

PARTS = 12
ROWS = 20000
FLAGS = ["--x-mm=-5,5", "--y-mm=-5,5", "--theta-max-deg=80", "--angular-degree=8"]
NAMES = ["x_mm", "y_mm", "theta_deg", "phi_deg", "radiance_w_per_m2_sr", "u_radiance_w_per_m2_sr"]


def rows(dice, count):
    for _ in range(count):
        theta, phi = dice.uniform(0, 80), dice.uniform(-180, 180)
        value = 60 * math.cos(math.radians(theta)) ** 4 + dice.gauss(0, 0.5)
        yield [dice.uniform(-5, 5), dice.uniform(-5, 5), theta, phi, value, 0.5]


def write(path, lines):
    with open(path, "w", newline="") as file:
        out = csv.writer(file)
        out.writerow(NAMES)
        out.writerows(lines)


def main(gonio):
    here = pathlib.Path(__file__).parent
    dice = random.Random(7)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "parts").mkdir()
        everything = []
        for number in range(PARTS):
            lines = list(rows(dice, ROWS))
            everything += lines
            path = folder / "parts" / f"part{number:02}.csv"
            write(path, lines)
            if number % 3 == 2:
                table = pyarrow.csv.read_csv(path)
                pyarrow.parquet.write_table(table, path.with_suffix(".parquet"))
                path.unlink()
        write(folder / "all.csv", everything)
        fitted, restarted = on_a_cluster(here, folder, gonio)
        whole = folder / "all.bin"
        run(gonio, "fit", folder / "all.csv", "--partial", "-o", whole, *FLAGS)
        run(gonio, "fit", "--merge", whole, "-o", folder / "all.json")
        expected = json.loads((folder / "all.json").read_text())
        assert fitted["n_used"] == expected["n_used"] == PARTS * ROWS, fitted["n_used"]
        scale = max(map(abs, expected["coefficients"]))
        pairs = zip(fitted["coefficients"], expected["coefficients"])
        worst = max(abs(a - b) for a, b in pairs) / scale
        assert worst < 1e-11, worst
        print(f"{PARTS} parts, {PARTS * ROWS} samples, {len(expected['coefficients'])} coefficients")
        print(f"one of two workers killed; {restarted} worker left at the end")
        print(f"largest difference from one fit of all, over the largest coefficient: {worst:.1e}")


def on_a_cluster(here, folder, gonio):
    """The merged fit, and how many workers were left."""
    port = 18786
    processes = [start("scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")]
    address = f"tcp://127.0.0.1:{port}"
    try:
        for _ in range(2):
            worker = ("worker", address, "--nthreads", "1", "--no-nanny", "--no-dashboard")
            processes.append(start(*worker, "--local-directory", str(folder)))
        with Client(address, timeout=60) as client:
            client.wait_for_workers(2, timeout=60)
            script = [sys.executable, here / "dask_fit.py", folder / "parts", "--gonio", gonio]
            output = folder / "fit.json"
            script += ["--scheduler", address, "-o", output, *FLAGS]
            fit = subprocess.Popen(list(map(str, script)), stdout=subprocess.DEVNULL)
            doomed = processes[1]
            wait_until_done(client, some=2)
            doomed.send_signal(signal.SIGKILL)
            doomed.wait()
            assert fit.wait(timeout=300) == 0
            left = len(client.scheduler_info()["workers"])
            assert left == 1, left
            return json.loads(output.read_text()), left
    finally:
        for process in reversed(processes):
            if process.poll() is None:
                process.terminate()
                process.wait(timeout=30)


def wait_until_done(client, some):
    """Until so many partial fits are done, and others are not."""
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        states = client.run_on_scheduler(
            lambda dask_scheduler: [task.state for task in dask_scheduler.tasks.values()]
        )
        if states.count("memory") >= some:
            assert states.count("memory") < PARTS, "all parts were done before the worker died"
            return
        time.sleep(0.02)
    raise TimeoutError("no partial fit was done in two minutes")


def start(*arguments):
    command = [sys.executable, "-m", "distributed.cli.dask_" + arguments[0], *arguments[1:]]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def run(*command):
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL)


if __name__ == "__main__":
    main(sys.argv[1])
