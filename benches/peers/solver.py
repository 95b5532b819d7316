"""Our streamed solver beside LAPACK's, in one run: CSV, a figure, and docs/fit-speed.md.

Usage: solver.py SOLVER CASES FIGURES DOCUMENT DATE BESIDE [--short], where SOLVER is the example
`solver` of the crate fit.

Each contender is a process of its own, on one core unless it says two threads; they take turns, and
the least processor time of all turns counts, since a busy machine only ever adds to it. Of the peers
the time is that of the solution alone, the matrix being there; ours includes making the rows and
starting the program. Memory is the most that the process ever held, the interpreter's own included.
"""

import csv
import json
import math
import os
import pathlib
import subprocess
import sys
import time

PEERS = ["lstsq", "gelsy", "lstsq-2", "dgeqrf", "ours"]
LOCAL = [(20, 40), (26, 68), (30, 72), (40, 110), (60, 160), (80, 220), (110, 300)]
NAMES = {
    "lstsq": "numpy.linalg.lstsq (gelsd)",
    "gelsy": "scipy.linalg.lstsq (gelsy)",
    "lstsq-2": "numpy.linalg.lstsq, two threads",
    "dgeqrf": "streamed dgeqrf, blocks of 8 p rows",
    "ours": "gonio",
}


def main(solver, cases, figures, document, date, beside, *rest):
    short = "--short" in rest
    figures = pathlib.Path(figures)
    errors = reference(solver, cases)
    rows = versus(solver, 100_000, 256, 2, PEERS)
    curves = against_rows(solver, 5 if short else 7) + against_columns(solver, 10 if short else 12)
    local = against_spans(solver, LOCAL[:2] if short else LOCAL)
    write(figures, document, rows, curves, local, errors, date, beside)
    if not short:
        # The slowest peers are left out: each would take as long again as all others together.
        rows += versus(solver, 1_000_000, 256, 1, ["ours", "dgeqrf", "lstsq"])
        write(figures, document, rows, curves, local, errors, date, beside)


def write(figures, document, rows, curves, local, errors, date, beside):
    with open(figures / "solver.csv", "w") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(["what", "rows", "columns", "processor_s", "wall_s", "peak_mb", "error"])
        for name, n, p, cpu, wall, peak, error in rows + curves:
            out.writerow([name, n, p, f"{cpu:.4g}", f"{wall:.4g}", f"{peak:.4g}", f"{error:.2e}"])
    draw(curves, figures / "solver.svg")
    text = report(rows, curves, local, errors, date, beside)
    pathlib.Path(document).write_text(text)


# What is measured


def versus(solver, n, p, turns, peers):
    best = {}
    for _ in range(turns):
        for peer in peers:
            result = ours(solver, n, p) if peer == "ours" else of_peer(peer, n, p)
            if peer not in best or result[0] < best[peer][0]:
                best[peer] = result
            print(peer, n, p, result, file=sys.stderr)
    return [(NAMES[peer], n, p, *best[peer]) for peer in peers]


def against_rows(solver, most):
    return [("rows", 10**k, 64, *ours(solver, 10**k, 64)) for k in range(3, most + 1)]


def against_columns(solver, most):
    return [("columns", 8_192, 2**k, *ours(solver, 8_192, 2**k)) for k in range(6, most + 1)]


def against_spans(solver, spans):
    """Readings, functions, processor s, peak MB, RMS error over u: of splines, dense and sparse."""
    found = []
    for theta, phi in spans:
        cpu, _, (count, error, peak_kib) = timed(solver, "local", 20_000, theta, phi)
        found.append((20_000, int(count), cpu, peak_kib / 1024, error))
        print("local", *found[-1], file=sys.stderr)
    return found


def ours(solver, n, p):
    """Processor and wall seconds, peak MB, error."""
    cpu, wall, (error, peak_kib) = timed(solver, "stream", n, p)
    return cpu, wall, peak_kib / 1024, error


def timed(solver, *words):
    """Processor and wall seconds, and the numbers that it prints."""
    began = time.perf_counter()
    command = ["taskset", "--cpu-list", "0", solver, *map(str, words)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    numbers = tuple(map(float, process.stdout.read().split()))
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return usage.ru_utime + usage.ru_stime, time.perf_counter() - began, numbers


def of_peer(peer, n, p):
    threads = "2" if peer.endswith("-2") else "1"
    environment = dict(os.environ, OPENBLAS_NUM_THREADS=threads, OMP_NUM_THREADS=threads)
    command = [sys.executable, __file__, "--peer", peer.removesuffix("-2"), str(n), str(p)]
    if threads == "1":
        command = ["taskset", "--cpu-list", "0", *command]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    return tuple(map(float, done.stdout.split()))


def peer(name, n, p):
    """In a process of its own: prints what `ours` returns."""
    import numpy as np

    expected = np.arange(1, p + 1) / p

    def rows(begin, end):
        with np.errstate(over="ignore"):
            z = (np.arange(begin * p + 1, end * p + 1, dtype=np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
            z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
            z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
            z = (z ^ (z >> np.uint64(31))) >> np.uint64(11)
        a = (z.astype(np.float64) * 2.0**-52 - 1.0).reshape(end - begin, p)
        return a, a @ expected

    spent = waited = 0.0

    def timed(act):
        nonlocal spent, waited
        began, wall = time.process_time(), time.perf_counter()
        answer = act()
        spent += time.process_time() - began
        waited += time.perf_counter() - wall
        return answer

    if name == "dgeqrf":
        r = np.zeros((0, p + 1))
        for begin in range(0, n, 8 * p):
            a, b = rows(begin, min(begin + 8 * p, n))
            r = timed(lambda: np.linalg.qr(np.vstack([r, np.column_stack([a, b])]), mode="r"))
        found = timed(lambda: np.linalg.solve(r[:p, :p], r[:p, p]))
    else:
        a, b = np.empty((n, p)), np.empty(n)
        for begin in range(0, n, 8192):
            end = min(begin + 8192, n)
            a[begin:end], b[begin:end] = rows(begin, end)
        if name == "lstsq":
            found = timed(lambda: np.linalg.lstsq(a, b, rcond=None)[0])
        else:
            import scipy.linalg

            found = timed(lambda: scipy.linalg.lstsq(a, b, lapack_driver="gelsy", check_finite=False)[0])
    # Not getrusage, which counts the memory of the process that started this one, too.
    status = open("/proc/self/status").read().splitlines()
    peak = next(int(line.split()[1]) / 1024 for line in status if line.startswith("VmHWM:"))
    print(spent, waited, peak, float(np.max(np.abs(found - expected))))


def reference(solver, cases):
    """Relative errors of the ill-conditioned rows of the reference cases, as they stand: powers of x
    that nobody centred, columns that nobody scaled."""
    import numpy as np
    import scipy.linalg

    found = []
    for case in map(json.loads, open(cases)):
        inputs = case["inputs"]
        if case["quantity"] == "polyfit-coefficient":
            x = np.array(inputs["x"])
            a = np.vander(x, inputs["degree"] + 1, increasing=True)
        elif case["quantity"] == "linear-fit-coefficient":
            columns = [np.array(column) for column in inputs["columns"]]
            a = np.column_stack([np.ones(len(columns[0])), *columns])
        else:
            continue
        b, index, exact = np.array(inputs["y"]), inputs["index"], float(case["expected"])
        text = "".join(" ".join(map(repr, map(float, [*row, y]))) + "\n" for row, y in zip(a, b))
        command = [solver, "rows", str(a.shape[1])]
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
        *values, condition = map(float, done.stdout.split())
        candidates = {
            "gonio": values[index],
            "gelsd": np.linalg.lstsq(a, b, rcond=None)[0][index],
            "gelsy": scipy.linalg.lstsq(a, b, lapack_driver="gelsy")[0][index],
        }
        errors = {name: abs(value / exact - 1.0) for name, value in candidates.items()}
        found.append((case["id"], case["note"], condition, errors))
    return found


# What is written


def draw(curves, path):
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "solver", "font.size": 9})
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
    for axis, what, place, label in [
        (axes[0], "rows", 1, "readings (64 coefficients)"),
        (axes[1], "columns", 2, "coefficients (8,192 readings)"),
    ]:
        points = [curve for curve in curves if curve[0] == what]
        x = [point[place] for point in points]
        axis.loglog(x, [point[3] for point in points], "o-", color="#0072B2", label="processor time / s")
        axis.loglog(x, [point[5] for point in points], "s--", color="#D55E00", label="peak memory / MB")
        axis.set_xlabel(label)
        axis.grid(True, alpha=0.3)
        axis.legend(fontsize=8)
    figure.savefig(path, metadata={"Date": None, "Creator": None})


def report(rows, curves, local, errors, date, beside):
    lines = [
        "# The solver, measured",
        "",
        "Written by `benches/peers/solver.sh`, which says how; nothing here is typed by hand. "
        f"{date}. Beside it ran: {beside}. So the least processor time of two turns (of one at 1e6 rows) is given, and wall time "
        "not at all.",
        "",
        "The peers' time is that of the solution alone, with the matrix in memory; ours includes making the rows "
        "and starting the program. Memory is the process's peak, interpreter included.",
        "",
        "| solver | rows x columns | processor s | peak MB | largest error of a coefficient | time over ours |",
        "|---|---|---|---|---|---|",
    ]
    for name, n, p, cpu, _, peak, error in rows:
        own = next(row[3] for row in rows if row[0] == "gonio" and row[1:3] == (n, p))
        lines.append(f"| {name} | {n:.0e} x {p} | {cpu:.2f} | {peak:.0f} | {error:.1e} | {cpu / own:.1f} |")
    lines.append("")
    for n, p in dict.fromkeys(row[1:3] for row in rows):
        of = {row[0]: row for row in rows if row[1:3] == (n, p)}
        own, lstsq, streamed = of["gonio"], of[NAMES["lstsq"]], of[NAMES["dgeqrf"]]
        aims = [
            ("at least 3 times as fast as numpy.linalg.lstsq at no larger error", lstsq[3] >= 3 * own[3] and own[6] <= 2 * lstsq[6]),
            ("faster than LAPACK's streamed QR", streamed[3] > own[3]),
            ("under 100 MB", own[5] < 100),
        ]
        for aim, met in aims:
            lines.append(f"- {n:.0e} x {p}: {aim}: **{'met' if met else 'missed'}**")
    lines += ["", "## Against readings and coefficients", "", "![Processor time and memory](figures/solver.svg)", ""]
    lines += ["| readings | coefficients | processor s | peak MB | allowed MB | error |", "|---|---|---|---|---|---|"]
    for _, n, p, cpu, _, peak, error in curves:
        allowed = 100 if p <= 256 else 50 + 3 * 8 * p * p / 2**20
        lines.append(f"| {n:.0e} | {p} | {cpu:.3g} | {peak:.0f} | {allowed:.0f} | {error:.1e} |")
    over = [row for row in curves if row[5] > (100 if row[2] <= 256 else 50 + 24 * row[2] ** 2 / 2**20)]
    said = "met" if not over else "missed at " + ", ".join(f"{row[1]:.0e} x {row[2]}" for row in over)
    lines += ["", f"Memory within 100 MB up to 256 coefficients and 50 MB + 3 x 8 p² bytes beyond: **{said}**.", ""]
    lines += [
        "## Many local functions",
        "",
        "A whole fit of 20,000 scattered readings in penalised splines of θ and φ, with its weights: up to 2,000 functions by the dense "
        "triangle, beyond by the sparse factor. The error is the RMS of the field at other places over the readings' u.",
        "",
        "| functions | way | processor s | peak MB | error / u |",
        "|---|---|---|---|---|",
    ]
    for _, count, cpu, peak, error in local:
        way = "dense" if count <= 2000 else "sparse"
        lines.append(f"| {count} | {way} | {cpu:.2f} | {peak:.0f} | {error:.3f} |")
    lines += [""]
    lines += [
        "## Ill-conditioned reference cases",
        "",
        "Relative error of the coefficient that the case asks for, from the same matrix as it stands (NIST's Wampler, Longley "
        "and Filip, and a drift against Unix microseconds). The condition is ours, with columns of equal length.",
        "",
        "| case | condition | gonio | numpy lstsq (gelsd) | scipy lstsq (gelsy) |",
        "|---|---|---|---|---|",
    ]
    for id, note, condition, of in errors:
        numbers = " | ".join(f"{of[name]:.1e}" for name in ("gonio", "gelsd", "gelsy"))
        lines.append(f"| {id} {note} | {condition:.1e} | {numbers} |")
    best = sum(min(of, key=of.get) == "gonio" for *_, of in errors)
    lines += ["", f"Smallest error of the three in {best} of {len(errors)} cases."]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    if sys.argv[1] == "--peer":
        peer(sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
    else:
        main(*sys.argv[1:])
