"""Peers and our kernels on the same reference cases, in one run: CSV of values, errors and times.

Usage: measure.py CASES ROWS OUTPUT, where ROWS is the program `rows` of the crate benches.

Mitsuba 3 answers by its own light sampling at the point (sample_emitter_direction with the
visibility test, weight times cosine), which is the best case for it; pyviewfactor by its default
semi-analytic kernel, through its public function and bare on plain arrays. Times are processor time
per value, warm: compilation and loading are left out. The error of a random method is the root mean
square over seeds.
"""

import csv
import json
import math
import subprocess
import sys
import time

import drjit as dr
import mitsuba as mi
import numpy as np
import pyvista
import pyviewfactor

# One case of each kind for the curves, and the powers of two of samples.
LADDER_ROWS = ["poly004", "disk022", "sph015", "pen029", "pen056"]
LADDER = [8, 12, 16, 20]
# Every other case that Mitsuba can be asked.
POWER = 16
SEEDS = 8
FEW_SEEDS = 4


def main(cases_path, rows_path, output_path):
    cases = [json.loads(line) for line in open(cases_path)]
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(1)
    output = csv.writer(open(output_path, "w"), lineterminator="\n")
    output.writerow(["row", "quantity", "solver", "effort", "value", "relative_error", "of_tolerance", "seconds"])
    asked, eased = [], []
    for case in cases:
        if case["expected"] in ("none", "0"):
            continue
        answers = list(of_mitsuba(case)) if is_light(case) else list(of_pyviewfactor(case))
        if answers:
            asked.append(case)
        exact = float(case["expected"]) if answers else None
        for solver, effort, values, seconds in answers:
            error = write(output, case, solver, effort, values, exact, seconds)
            if "relative_tolerance" in case["inputs"]:
                eased.append((case, effort, error))
    at_equal_error(output, eased, rows_path)
    closed = {case["id"] + "-polygons": case for case in cases if case["id"].startswith("ff_")}
    for name, case, (value, ns) in zip(*ours(asked, rows_path)):
        write(output, case, name, "", [value], float(case["expected"]), 1e-9 * ns)
    pairs = [(row, closed[row["id"]]) for row in asked if row["id"] in closed]
    answers = ours([case for _, case in pairs], rows_path)[2]
    for (row, case), (value, ns) in zip(pairs, answers):
        if value is not None and case["quantity"] != "form-factor-wedge-rectangles":
            write(output, row, "radiometry closed form", "", [value], float(case["expected"]), 1e-9 * ns)


def write(output, case, solver, effort, values, exact, seconds):
    """One line; the error that it states."""
    errors = [value / exact - 1.0 for value in values]
    rms = math.sqrt(sum(error * error for error in errors) / len(errors))
    mean = sum(values) / len(values)
    allowed = case["abs_tol"] + case["rel_tol"] * abs(exact)
    output.writerow(
        [case["id"], case["quantity"], solver, effort, repr(mean), f"{rms:.3e}"]
        + [f"{abs(mean - exact) / allowed:.3e}", f"{seconds:.4e}"]
    )
    return rms


def at_equal_error(output, asked, rows_path):
    """Our quickest answer whose error is no larger than the peer's, over tolerances 0.1 to 1e-12."""
    tolerances = [10.0**-power for power in range(1, 13)]
    cases = {case["id"]: case for case, _, _ in asked}
    answers = {}
    for id, case in cases.items():
        eased = [case | {"inputs": case["inputs"] | {"relative_tolerance": t}} for t in tolerances]
        answers[id] = ours(eased, rows_path)[2]
    for case, effort, error in asked:
        exact = float(case["expected"])
        within = [(ns, value) for value, ns in answers[case["id"]] if abs(value / exact - 1.0) <= error]
        if within:
            ns, value = min(within)
            write(output, case, "radiometry at the peer's error", effort, [value], exact, 1e-9 * ns)


def ours(cases, rows_path):
    """Names, cases and (value, ns) of our own kernels."""
    lines = "".join(json.dumps(case) + "\n" for case in cases)
    run = subprocess.run([rows_path], input=lines, capture_output=True, text=True, check=True)
    answers = [line.split(",") for line in run.stdout.splitlines()]
    answers = [(float(value), float(ns)) if value else (None, None) for _, value, ns in answers]
    return ["radiometry"] * len(cases), cases, answers


def processor_s(act, repeats):
    """The median time of an act, after one to warm up."""
    act()
    times = []
    for _ in range(repeats):
        began = time.process_time()
        act()
        times.append(time.process_time() - began)
    return sorted(times)[len(times) // 2]


# Mitsuba


def is_light(case):
    return case["quantity"] in (
        "polygon-projected-solid-angle",
        "projected-solid-angle-of-disk",
        "projected-solid-angle-of-sphere",
        "occluded-projected-solid-angle",
    )


def of_mitsuba(case):
    inputs = case["inputs"]
    bodies = bodies_of(case)
    if bodies is None:
        return
    point, normal = np.array(inputs["point"]), np.array(inputs["normal"])
    scene = {"type": "scene", "source": shape(bodies[0], point, True)}
    if len(bodies) == 2:
        scene["occluder"] = shape(bodies[1], point, False)
    scene = mi.load_dict(scene)
    powers = LADDER if case["id"] in LADDER_ROWS else [POWER]
    for power in powers:
        count = 1 << power
        seeds = SEEDS if case["id"] in LADDER_ROWS else FEW_SEEDS
        evaluate = lambda seed: irradiance(scene, point, normal / np.linalg.norm(normal), count, seed)
        values = [evaluate(seed) for seed in range(seeds)]
        seconds = processor_s(lambda: evaluate(0), 5)
        yield "Mitsuba 3", f"2^{power} samples", values, seconds


def bodies_of(case):
    """The source and what stands in the way; None where Mitsuba has no such shape."""
    inputs = case["inputs"]
    quantity = case["quantity"]
    if quantity == "occluded-projected-solid-angle":
        bodies = [inputs["source"], inputs["occluder"]]
        if any(body["kind"] == "half-plane" for body in bodies):
            return None
    elif quantity == "polygon-projected-solid-angle":
        bodies = [{"kind": "polygon", "vertices": inputs["vertices"]}]
    else:
        kind = "disk" if "axis" in inputs else "sphere"
        bodies = [{"kind": kind} | inputs]
    for body in bodies:
        # A fan of triangles is the polygon only where that is convex.
        if body["kind"] == "polygon" and not is_convex(np.array(body["vertices"])):
            return None
    return bodies


def is_convex(corners):
    edges = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(edges, np.roll(edges, -1, axis=0))
    return bool(np.all(turns @ turns[0] > 0.0))


def shape(body, towards, shines):
    """A shape that shines, with radiance 1, to the side of a point; or that stands in the way."""
    light = {"emitter": {"type": "area", "radiance": {"type": "rgb", "value": 1.0}}} if shines else {}
    if body["kind"] == "sphere":
        return {"type": "sphere", "center": body["center"], "radius": body["radius"]} | light
    if body["kind"] == "disk":
        center, axis = np.array(body["center"]), np.array(body.get("axis", [0.0, 0.0, 1.0]))
        axis = axis / np.linalg.norm(axis)
        axis = axis if axis @ (towards - center) >= 0.0 else -axis
        across = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
        to_world = mi.ScalarTransform4f().look_at(
            origin=center.tolist(), target=(center + axis).tolist(), up=across.tolist()
        ) @ mi.ScalarTransform4f().scale([body["radius"], body["radius"], 1.0])
        return {"type": "disk", "to_world": to_world} | light
    corners = np.array(body["vertices"])
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    if normal @ (towards - corners[0]) < 0.0:
        corners = corners[::-1]
    faces = [[0, k, k + 1] for k in range(1, len(corners) - 1)]
    properties = mi.Properties()
    if shines:
        properties["emitter"] = mi.load_dict(light["emitter"])
    mesh = mi.Mesh("polygon", len(corners), len(faces), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = mi.Float(corners.ravel())
    parameters["faces"] = mi.UInt32(np.array(faces).ravel())
    parameters.update()
    return mesh


def irradiance(scene, point, normal, count, seed):
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, wavefront_size=count)
    at = dr.zeros(mi.SurfaceInteraction3f)
    at.p = mi.Point3f(*point.tolist())
    at.n = mi.Normal3f(*normal.tolist())
    at.sh_frame = mi.Frame3f(at.n)
    at.time = 0.0
    direction, weight = scene.sample_emitter_direction(at, sampler.next_2d(), True)
    received = weight.x * dr.maximum(0.0, dr.dot(direction.d, at.n))
    return float(dr.mean(received)[0])


# pyviewfactor


def of_pyviewfactor(case):
    if case["quantity"] != "form-factor-polygons":
        return
    first, second = (np.array(case["inputs"][key]) for key in ("from", "to"))
    # It takes normals to face each other for granted: of both orders the one that it has a value for.
    candidates = [second, second[::-1]]
    values = [pyviewfactor.compute_viewfactor(face(c), face(first)) for c in candidates]
    best = int(np.argmax(values))
    second, value = candidates[best], values[best]
    cells = face(second), face(first)
    seconds = processor_s(lambda: [pyviewfactor.compute_viewfactor(*cells) for _ in range(20)], 7) / 20
    yield "pyviewfactor", "public function", [value], seconds
    second, first = np.ascontiguousarray(second), np.ascontiguousarray(first)
    constant = 4.0 * np.pi * pyviewfactor.polygon_area(first)
    bare = lambda: pyviewfactor.compute_viewfactor_sa30(second, first, constant)
    value = bare()
    seconds = processor_s(lambda: [bare() for _ in range(50)], 7) / 50
    yield "pyviewfactor", "bare kernel", [value], seconds


def face(corners):
    return pyvista.PolyData(np.array(corners), faces=[len(corners), *range(len(corners))])


if __name__ == "__main__":
    main(*sys.argv[1:])
