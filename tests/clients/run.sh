#!/usr/bin/env bash
# Independent clients drive the simulated devices: a driver and a twin of one hand agree by
# construction, and somebody else's client does not. The clients come from PyPI into
# target/clients; without Python, or without PyPI, it says so and skips.
#
#   tests/clients/run.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
environment=target/clients
if ! command -v python3 >/dev/null; then
    echo "skipped: no python3 here" >&2
    exit 0
fi
if [ ! -x "$environment/bin/python" ]; then
    python3 -m venv "$environment"
fi
if ! "$environment/bin/pip" install --quiet --requirement tests/clients/requirements.txt; then
    echo "skipped: the clients can't be installed from PyPI" >&2
    exit 0
fi
cargo build --package gonio
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
example=examples/servo-arm
"$environment/bin/python" tests/clients/servos.py \
    "$PWD/target/debug/gonio" $example/rig.toml $example/scene.toml "$folder/servos"
"$environment/bin/python" tests/clients/meters.py \
    "$PWD/target/debug/gonio" $example/rig.toml $example/scene.toml "$folder/meter"
"$environment/bin/python" tests/clients/grbl_job.py \
    "$PWD/target/debug/gonio" examples/lambertian/scene.toml "$folder/grbl"
