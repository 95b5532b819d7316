"""Our fit beside scipy's splines and scikit-learn's Gaussian process, on the same readings: the section
"fits" of docs/measured.md and its numbers.

Usage: fits.py DIRECTORY FIGURES DOCUMENT DATE BESIDE [SCENE ..], where DIRECTORY is what the example
`scenes` of the crate fit wrote.

Ours chooses everything from the readings. Each peer is run with many settings, and the one with the
smallest error is taken, the truth being known: more than anybody could do who has the readings alone.
A Gaussian process fits its own length scales. Error is the RMS of value - truth over that of the truth,
at rays that lie evenly in throughput over the region.
"""

import csv
import itertools
import pathlib
import re
import sys
import time
import warnings

import numpy as np
import scipy.interpolate as spline
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Matern

SAID = {
    "limb": "limb darkening",
    "batwing": "batwing, two lobes",
    "gap": "batwing, nothing read from 35° to 45°",
    "gloss": "gloss lobe, 16° wide, at 45°",
    "grazing": "grazing lobe, 7° by 62°, at 78°",
    "cos400": "cos^400, leaning by 2°",
    "cos2000": "cos^2000, leaning by 2°",
    "moving": "lobe that moves over the patch",
    "stripe": "bright line 3.5 mm wide under a 5 mm spot",
}


def main(directory, figures, document, date, beside, *only):
    warnings.simplefilter("ignore")
    directory = pathlib.Path(directory)
    rows = []
    for scene in csv.DictReader(open(directory / "scenes.csv")):
        if not only or scene["scene"] in only:
            rows.append(of_scene(directory, scene))
    with open(pathlib.Path(figures) / "fits.csv", "w") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["scene", "readings", "solver", "setting", "relative_error", "processor_s"])
        for scene, found in rows:
            for name, (error, seconds, setting) in found.items():
                out.writerow([scene["scene"], scene["readings"], name, setting, f"{error:.4e}", f"{seconds:.3g}"])
    replace(document, "fits", section(rows, date, beside))


def of_scene(directory, scene):
    name = scene["scene"]
    load = lambda kind: np.loadtxt(directory / f"{name}.{kind}.csv", delimiter=",")
    readings, truth, ours = load("readings"), load("truth"), load("ours")
    error = lambda values: float(np.sqrt(np.mean((values - truth[:, 4]) ** 2) / np.mean(truth[:, 4] ** 2)))
    cover = float(np.sqrt(np.mean(((ours[:, 0] - truth[:, 4]) / ours[:, 1]) ** 2)))
    seconds = float(scene["choice_s"]) + float(scene["fit_s"])
    found = {"gonio": (error(ours[:, 0]), seconds, f"error/u {cover:.2f}")}
    for peer in PEERS:
        best = None
        for setting, act in peer(readings):
            began = time.process_time()
            try:
                values = act(truth)
            except (ValueError, np.linalg.LinAlgError, MemoryError):
                continue
            spent = time.process_time() - began
            if np.all(np.isfinite(values)) and (best is None or error(values) < best[0]):
                best = (error(values), spent, setting)
        if best is not None:
            found[peer.__name__] = best
            print(name, peer.__name__, *best, file=sys.stderr)
    print(name, "gonio", *found["gonio"], file=sys.stderr)
    return scene, found


# Peers: each yields settings, with a function from the truth's rays to values.


def varies(readings):
    return [k for k in (0, 1) if np.ptp(readings[:, k]) > 0]


def features(rays, readings):
    """Direction cosines, and the place over its half width."""
    theta, phi = rays[:, 2], rays[:, 3]
    columns = [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)]
    for k in varies(readings):
        columns.append(2 * (rays[:, k] - readings[:, k].mean()) / np.ptp(readings[:, k]))
    return np.column_stack(columns)


def disk(rays):
    """Equal-area disk: the pole is no special place, and the horizon is not squeezed."""
    r = np.sqrt(2) * np.sin(rays[:, 2] / 2)
    return r * np.cos(rays[:, 3]), r * np.sin(rays[:, 3])


def rect_bivariate_spline(readings):
    """scipy.interpolate.RectBivariateSpline on the raster of (φ, θ), periodic by repetition."""
    if varies(readings):
        return
    theta = np.unique(np.round(readings[:, 2], 9))
    phi = np.unique(np.round(readings[:, 3] % (2 * np.pi), 9) % round(2 * np.pi, 9))
    grid = np.full((len(phi), len(theta)), np.nan)
    for ray in readings:
        j = np.argmin(np.abs(theta - ray[2]))
        if ray[2] < 1e-9:
            continue
        turns = np.abs((phi - ray[3] + np.pi) % (2 * np.pi) - np.pi)
        grid[np.argmin(turns), j] = ray[4]
    pole = readings[readings[:, 2] < 1e-9, 4].mean()
    grid[:, theta < 1e-9] = pole
    # Past the pole on the other side, so that it is no edge.
    half = len(phi) // 2
    mirrored = np.roll(grid, half, axis=0)[:, ::-1][:, :-1]
    both = np.hstack([mirrored, grid])
    along = np.concatenate([-theta[:0:-1], theta])
    around = np.concatenate([phi - 2 * np.pi, phi, phi + 2 * np.pi])
    whole = np.vstack([both, both, both])
    u2 = readings[0, 5] ** 2 * whole.size
    for degree, smooth in itertools.product([3, 5], [0, 0.3, 0.6, 1.0]):
        def act(truth, degree=degree, smooth=smooth):
            around_degree = min(degree, len(around) - 1)
            fit = spline.RectBivariateSpline(around, along, whole, kx=around_degree, ky=degree, s=smooth * u2)
            return fit.ev(truth[:, 3] % (2 * np.pi), truth[:, 2])
        yield f"degree {degree}, s = {smooth} n u²", act


def smooth_bivariate_spline(readings):
    """scipy.interpolate.SmoothBivariateSpline over the equal-area disk."""
    if varies(readings):
        return
    x, y = disk(readings)
    for degree, smooth in itertools.product([3, 5], [0.5, 0.7, 0.85, 1.0, 1.2]):
        def act(truth, degree=degree, smooth=smooth):
            weights = 1 / readings[:, 5]
            fit = spline.SmoothBivariateSpline(x, y, readings[:, 4], w=weights, kx=degree, ky=degree, s=smooth * len(x))
            return fit.ev(*disk(truth))
        yield f"degree {degree}, s = {smooth} n", act


def smooth_sphere_bivariate_spline(readings):
    """scipy.interpolate.SmoothSphereBivariateSpline."""
    if varies(readings):
        return
    for smooth in [0.7, 0.85, 1.0, 1.2]:
        def act(truth, smooth=smooth):
            weights = 1 / readings[:, 5]
            fit = spline.SmoothSphereBivariateSpline(
                readings[:, 2], readings[:, 3] % (2 * np.pi), readings[:, 4], w=weights, s=smooth * len(readings)
            )
            return fit.ev(truth[:, 2], truth[:, 3] % (2 * np.pi))
        yield f"s = {smooth} n", act


def lsq_sphere_bivariate_spline(readings):
    """scipy.interpolate.LSQSphereBivariateSpline."""
    if varies(readings):
        return
    for in_theta, in_phi in [(4, 6), (8, 8), (12, 10), (16, 12), (24, 12), (32, 12), (48, 12), (64, 12)]:
        def act(truth, in_theta=in_theta, in_phi=in_phi):
            knots_theta = np.linspace(0, readings[:, 2].max(), in_theta + 2)[1:-1]
            knots_phi = np.linspace(0, 2 * np.pi, in_phi + 2)[1:-1]
            fit = spline.LSQSphereBivariateSpline(
                readings[:, 2], readings[:, 3] % (2 * np.pi), readings[:, 4], knots_theta, knots_phi, w=1 / readings[:, 5]
            )
            return fit.ev(truth[:, 2], truth[:, 3] % (2 * np.pi))
        yield f"{in_theta} x {in_phi} knots", act


def rbf_interpolator(readings):
    """scipy.interpolate.RBFInterpolator over direction cosines and place."""
    at = features(readings, readings)
    _, first = np.unique(np.round(at, 12), axis=0, return_index=True)
    values = readings[:, 4]
    for kernel, smooth in itertools.product(["thin_plate_spline", "cubic", "quintic"], [0, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2]):
        def act(truth, kernel=kernel, smooth=smooth):
            fit = spline.RBFInterpolator(at[first], values[first], kernel=kernel, smoothing=smooth, neighbors=None if len(first) < 1500 else 150)
            return fit(features(truth, readings))
        yield f"{kernel}, smoothing {smooth:g}", act


def gaussian_process(readings):
    """sklearn.gaussian_process, one length scale a coordinate, fitted; the noise is told."""
    at, values = features(readings, readings), readings[:, 4]
    scale = values.std()
    few = np.random.default_rng(1).permutation(len(at))[:GP_FITTED]
    for name, kernel in [
        ("RBF", lambda n: RBF(np.full(n, 0.3), (1e-3, 1e2))),
        ("Matern 5/2", lambda n: Matern(np.full(n, 0.3), (1e-3, 1e2), nu=2.5)),
    ]:
        def act(truth, kernel=kernel):
            shape = ConstantKernel(1.0, (1e-3, 1e5)) * kernel(at.shape[1])
            alpha = (readings[:, 5] / scale) ** 2
            centred = (values - values.mean()) / scale
            process = GaussianProcessRegressor(shape, alpha=alpha[few], random_state=0)
            process.fit(at[few], centred[few])
            if len(few) < len(at):
                process = GaussianProcessRegressor(process.kernel_, alpha=alpha, optimizer=None).fit(at, centred)
            return process.predict(features(truth, readings)) * scale + values.mean()
        yield f"{name} kernel", act


PEERS = [
    rect_bivariate_spline,
    smooth_bivariate_spline,
    smooth_sphere_bivariate_spline,
    lsq_sphere_bivariate_spline,
    rbf_interpolator,
    gaussian_process,
]
# Readings that a process's length scales are fitted to; all readings make the prediction.
GP_FITTED = 700


# What is written


NAMES = {
    "rect_bivariate_spline": "RectBivariateSpline",
    "smooth_bivariate_spline": "SmoothBivariateSpline",
    "smooth_sphere_bivariate_spline": "SmoothSphereBivariateSpline",
    "lsq_sphere_bivariate_spline": "LSQSphereBivariateSpline",
    "rbf_interpolator": "RBFInterpolator",
    "gaussian_process": "Gaussian process",
}


# What is said of a scene where a peer has the smaller error.
WHY = {
    "batwing": "It is as smooth everywhere as a Gaussian process takes fields to be.",
    "gap": "It is as smooth everywhere as a Gaussian process takes fields to be.",
    "gloss": "The choice counts all readings left out alike: splines with a patch, which foretell the many of the flat parts "
    "better, outweigh harmonics, which follow the lobe better.",
    "cos400": "Splines of the same kind as ours, with the smoothing that the truth calls best.",
    "cos2000": "Splines of the same kind as ours, with the smoothing that the truth calls best.",
    "moving": "As on the gloss: splines with a patch outweigh polynomials on the disk, which follow the lobe better.",
}


def section(rows, date, beside):
    splines = [name for name in NAMES if name != "gaussian_process"]
    lines = [
        "## Our fit beside scipy's splines and a Gaussian process",
        "",
        "RMS error of L, weighted by throughput over the region, as a part of the RMS of L. The peers are given the same readings "
        "and their u, and of many settings the one that turns out best against the truth; ours has the readings alone. Seconds "
        "(processor time for the peers, wall time for us) for that one setting, for us the choice and the fit.",
        "",
        "| scene | readings | gonio, % | s | coefficients | best scipy spline, % | s | which | Gaussian process, % | s | smallest error |",
        "|---|--:|--:|--:|--:|--:|--:|---|--:|--:|---|",
    ]
    why = []
    for scene, found in rows:
        best = min((name for name in splines if name in found), key=lambda name: found[name][0], default=None)
        process = found["gaussian_process"]
        winner = min(filter(None, ["gonio", best, "gaussian_process"]), key=lambda name: found[name][0])
        if winner != "gonio":
            why.append(f"- {SAID[scene['scene']]}: {WHY.get(scene['scene'], 'not looked into.')}")
        # Splines of one direction know no places; neighbours at one place are too flat for RBFs.
        of_splines = f"{100 * found[best][0]:.3f} | {found[best][1]:.2f} | {NAMES[best]}, {found[best][2]}" if best else "none | | "
        lines.append(
            f"| {SAID[scene['scene']]} | {scene['readings']} | {100 * found['gonio'][0]:.3f} | {found['gonio'][1]:.2f} | {scene['coefficients']} "
            f"| {of_splines} "
            f"| {100 * process[0]:.3f} | {process[1]:.1f} | {NAMES.get(winner, '**gonio**')} |"
        )
    lines += ["", *why, "", f"`benches/peers/fits.sh`  ", f"{date} · beside it: {beside}"]
    return "\n".join(lines)


def replace(document, name, text):
    path = pathlib.Path(document)
    body = path.read_text()
    marked = f"<!-- begin {name} -->\n{text}\n<!-- end {name} -->"
    pattern = re.compile(f"<!-- begin {name} -->.*?<!-- end {name} -->", re.S)
    body = pattern.sub(lambda _: marked, body) if pattern.search(body) else body.rstrip("\n") + "\n\n" + marked + "\n"
    path.write_text(body)


if __name__ == "__main__":
    main(*sys.argv[1:])
