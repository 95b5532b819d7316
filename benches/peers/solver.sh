#!/usr/bin/env bash
# Our streamed solver beside numpy's and scipy's, in one run. Writes docs/fit-speed.md, its figure and
# its numbers.
#
#   benches/peers/solver.sh YYYY-MM-DD "what else ran" [--short]
set -euo pipefail
cd "$(dirname "$0")/../.."
environment=target/solver-peers
if [ ! -x "$environment/bin/python" ]; then
    python3 -m venv "$environment"
fi
"$environment/bin/pip" install --quiet --requirement benches/peers/solver-requirements.txt
cargo build --release --package fit --example solver
"$environment/bin/python" benches/peers/solver.py target/release/examples/solver \
    tests/data/cases.jsonl docs/figures docs/fit-speed.md "$@"
