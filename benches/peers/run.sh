#!/usr/bin/env bash
# Peers side by side with our kernels, in one run on one core: Mitsuba 3 and pyviewfactor, from PyPI
# with pinned versions, into a virtual environment under target/. Writes the section "peers" of
# docs/speed.md, its figure and its numbers.
#
#   benches/peers/run.sh --date YYYY-MM-DD [--beside TEXT]
#
# Mitsuba's fast variant needs an LLVM shared library. Versions 19 and 22 work; 15 aborts while it
# selects instructions for processors with AVX-512, 14 is not loaded. Say where it is (Debian:
# libllvm19): DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1
set -euo pipefail
cd "$(dirname "$0")/../.."
environment=target/peers
if [ ! -x "$environment/bin/python" ]; then
    python3 -m venv "$environment"
fi
"$environment/bin/pip" install --quiet --requirement benches/peers/requirements.txt
cargo build --release --package benches --bin rows --bin peers
# One core for everybody: nobody gains by threads.
OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 taskset --cpu-list 0 \
    "$environment/bin/python" benches/peers/measure.py \
    tests/data/cases.jsonl target/release/rows docs/figures/peers.csv
target/release/peers docs/figures/peers.csv --figure docs/figures/peers.svg --doc docs/speed.md "$@"
