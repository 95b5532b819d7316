#!/usr/bin/env python3
"""Fits a folder of CSV or Parquet parts on a Dask cluster: a partial fit of each part where a worker
is, then one merge.

    python dask_fit.py FOLDER --x-mm=-20,20 --y-mm=-20,20 --theta-max-deg 80 -o fit.json \\
        [--angular-degree N] [--position-degree N] [--scheduler tcp://HOST:8786] [--gonio PATH]

Every worker needs the program `gonio` and the folder (a shared file system). Parts are files
*.csv or *.parquet with the columns of samples.csv. What a lost worker had not finished is done again
elsewhere; a part counts once, since its result is kept by its name. Without --scheduler two workers
are started on this machine.
"""

import argparse
import pathlib
import subprocess
import sys
import tempfile

from dask.distributed import Client, LocalCluster


def partial(part, flags, gonio):
    """The partial fit of one part, as bytes. Runs on a worker."""
    with tempfile.TemporaryDirectory() as folder:
        source, output = pathlib.Path(part), pathlib.Path(folder) / "part.bin"
        if source.suffix == ".parquet":
            source = csv_of(source, pathlib.Path(folder) / "part.csv")
        command = [gonio, "fit", str(source), "--partial", "-o", str(output), *flags]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError(f"{part}: {done.stderr.strip()}")
        return output.read_bytes()


def csv_of(parquet, path):
    """A CSV of a Parquet file, a batch of rows at a time."""
    import pyarrow.csv
    import pyarrow.parquet

    file = pyarrow.parquet.ParquetFile(parquet)
    with pyarrow.csv.CSVWriter(path, file.schema_arrow) as writer:
        for batch in file.iter_batches(batch_size=65536):
            writer.write_batch(batch)
    return path


def merge(parts, output, gonio):
    """The fit of all parts, written to `output`; what gonio says of it."""
    with tempfile.TemporaryDirectory() as folder:
        paths = []
        for number, content in enumerate(parts):
            paths.append(pathlib.Path(folder) / f"part{number}.bin")
            paths[-1].write_bytes(content)
        command = [gonio, "fit", "--merge", *map(str, paths), "-o", str(output)]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode != 0:
            raise RuntimeError(done.stderr.strip())
        return done.stdout


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    arguments.add_argument("folder", type=pathlib.Path)
    arguments.add_argument("-o", "--output", default="fit.json")
    arguments.add_argument("--scheduler", help="default: two workers on this machine")
    arguments.add_argument("--gonio", default="gonio", help="the program, as a worker finds it")
    arguments, flags = arguments.parse_known_args()
    folder = arguments.folder.resolve()
    parts = sorted(str(p) for p in folder.iterdir() if p.suffix in (".csv", ".parquet"))
    if not parts:
        sys.exit(f"{folder}: no *.csv and no *.parquet")
    cluster = arguments.scheduler or LocalCluster(n_workers=2, threads_per_worker=1)
    with Client(cluster) as client:
        futures = [
            client.submit(partial, part, flags, arguments.gonio, key=f"partial-{part}", retries=2)
            for part in parts
        ]
        results = client.gather(futures)
    print(merge(results, arguments.output, arguments.gonio), end="")


if __name__ == "__main__":
    main()
