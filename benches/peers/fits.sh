#!/usr/bin/env bash
# Our fit beside scipy's splines and scikit-learn's Gaussian process, on the same readings of scenes of
# which the truth is known. Writes the section "fits" of docs/measured.md and docs/figures/fits.csv.
#
#   benches/peers/fits.sh YYYY-MM-DD "what else ran" [SCENE ..]
#
# Some minutes on one core, most of them the Gaussian process.
set -euo pipefail
cd "$(dirname "$0")/../.."
environment=target/fits-peers
if [ ! -x "$environment/bin/python" ]; then
    python3 -m venv "$environment"
fi
"$environment/bin/pip" install --quiet --requirement benches/peers/fits-requirements.txt
cargo build --release --package fit --example scenes
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
taskset --cpu-list 0 target/release/examples/scenes "$scratch" "${@:3}"
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
taskset --cpu-list 0 "$environment/bin/python" benches/peers/fits.py "$scratch" docs/figures \
    docs/measured.md "$@"
