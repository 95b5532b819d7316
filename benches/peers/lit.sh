#!/usr/bin/env bash
# A lit patch and a penumbra: Mitsuba 3 and ours in one run on one core. Writes the section "lit" of
# docs/measured.md and its numbers.
#
#   benches/peers/lit.sh --date YYYY-MM-DD [--beside TEXT]
#
# The environment and the LLVM library are as run.sh has them.
set -euo pipefail
cd "$(dirname "$0")/../.."
environment=target/peers
if [ ! -x "$environment/bin/python" ]; then
    python3 -m venv "$environment"
fi
"$environment/bin/pip" install --quiet --requirement benches/peers/requirements.txt
cargo build --release --package benches --bin lit
OMP_NUM_THREADS=1 taskset --cpu-list 0 "$environment/bin/python" benches/peers/lit.py \
    target/release/lit docs/figures/lit-peers.csv
target/release/lit docs/figures/lit-peers.csv --doc docs/measured.md "$@"
