"""A lit patch and a penumbra as a detector sees them: Mitsuba 3 beside our own answers, in one run.

Usage: lit.py LIT OUTPUT, where LIT is the program `lit` of the crate benches.

Mitsuba traces the beam's rays with its own `path` integrator (direct light), each from a random
place of the pupil through a random place of the spot. Times are processor time a value, warm:
compilation and loading are left out.
"""

import csv
import math
import subprocess
import sys

import drjit as dr
import mitsuba as mi

from measure import processor_s

POWERS = [8, 12, 16, 20]
SEEDS = 8
PUPIL, SPOT, DISTANCE = 0.00625, 0.0025, 0.3
X, Y, THETA, PHI = 0.01, 0.003, 0.5, 1.0


def main(lit_path, output_path):
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(1)
    output = csv.writer(open(output_path, "w"), lineterminator="\n")
    header = ["case", "solver", "effort", "value", "relative_error", "seconds", "compiled_seconds"]
    output.writerow(header)
    run = subprocess.run([lit_path, "--answers"], capture_output=True, text=True, check=True)
    expected = {}
    for row in csv.DictReader(run.stdout.splitlines()):
        exact, value = float(row["expected"]), float(row["value"])
        expected[row["case"]] = exact
        error = abs(value / exact - 1.0)
        effort = f"tolerance {float(row['tolerance']):.0e}"
        seconds = 1e-9 * float(row["ns"])
        times = [f"{seconds:.4e}", f"{1e-9 * float(row['compiled_ns']):.4e}"]
        output.writerow([row["case"], "gonio", effort, repr(value), f"{error:.3e}", *times])
    scenes = {False: scene(False), True: scene(True)}
    for case, exact in expected.items():
        world, is_beam = scenes["penumbra" in case], "beam" in case
        for power in POWERS:
            count = 1 << power
            evaluate = lambda seed: radiance(world, is_beam, count, seed)
            values = [evaluate(seed) for seed in range(SEEDS)]
            errors = [value / exact - 1.0 for value in values]
            rms = math.sqrt(sum(error * error for error in errors) / SEEDS)
            seconds = processor_s(lambda: evaluate(0), 7)
            mean = sum(values) / SEEDS
            output.writerow(
                [case, "Mitsuba 3", f"2^{power} samples", repr(mean), f"{rms:.3e}", f"{seconds:.4e}", ""]
            )


def scene(has_edge):
    to_world = mi.ScalarTransform4f
    parts = {
        "type": "scene",
        "panel": {
            "type": "rectangle",
            "to_world": to_world().scale([0.05, 0.05, 1.0]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.8}},
        },
        "lamp": {
            "type": "disk",
            "to_world": to_world().look_at(origin=[0, 0, 1.0], target=[0, 0, 0.0], up=[0, 1, 0])
            @ to_world().scale([0.04, 0.04, 1.0]),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1000.0}},
        },
    }
    if has_edge:
        # Wide enough to be a half-plane for this lamp.
        parts["edge"] = {
            "type": "rectangle",
            "to_world": to_world().translate([-0.5, 0, 0.6]) @ to_world().scale([0.5, 0.5, 1.0]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
        }
    return mi.load_dict(parts)


INTEGRATOR = None


def radiance(world, is_beam, count, seed):
    global INTEGRATOR
    INTEGRATOR = INTEGRATOR or mi.load_dict({"type": "path", "max_depth": 2})
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, wavefront_size=count)
    axis = mi.Vector3f(math.sin(THETA) * math.cos(PHI), math.sin(THETA) * math.sin(PHI), math.cos(THETA))
    spot, pupil = mi.Point3f(X, Y, 0.0), mi.Point3f(X, Y, 0.0) + DISTANCE * axis
    weight = mi.Float(1.0)
    if is_beam:
        frame = mi.Frame3f(axis)
        on_pupil = PUPIL * mi.warp.square_to_uniform_disk_concentric(sampler.next_2d())
        on_spot = SPOT * mi.warp.square_to_uniform_disk_concentric(sampler.next_2d())
        spot = spot + frame.s * on_spot.x + frame.t * on_spot.y
        pupil = pupil + frame.s * on_pupil.x + frame.t * on_pupil.y
        weight = dr.power(dr.dot(dr.normalize(pupil - spot), axis), 4)
    ray = mi.Ray3f(pupil, dr.normalize(spot - pupil))
    ray = mi.RayDifferential3f(ray)
    seen, _, _ = INTEGRATOR.sample(world, sampler, ray)
    value = dr.sum(seen.x * weight) / dr.sum(weight * dr.ones(mi.Float, count))
    return float(value[0])


if __name__ == "__main__":
    main(*sys.argv[1:])
