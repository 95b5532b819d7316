#!/usr/bin/env bash
# Dask with a scheduler and two workers, of which one is killed: docs/scale/dask_fit.py must lose
# nothing and count nothing twice. Dask and PyArrow come from PyPI into target/scale.
#
#   docs/scale/test.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
environment=target/scale
if [ ! -x "$environment/bin/python" ]; then
    python3 -m venv "$environment"
fi
"$environment/bin/pip" install --quiet --requirement docs/scale/requirements.txt
cargo build --package gonio
PATH="$PWD/target/debug:$PATH" "$environment/bin/python" docs/scale/test_dask.py \
    "$PWD/target/debug/gonio"
