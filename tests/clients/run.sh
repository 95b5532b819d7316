#!/usr/bin/env bash
# Independent clients drive the simulated devices: a driver and a twin of one hand agree by
# construction, and somebody else's client does not. The clients come from PyPI into
# target/clients; without Python, or without PyPI, it says so and skips.
#
#   tests/clients/run.sh             builds gonio first
#   GONIO=target/debug/gonio tests/clients/run.sh
set -euo pipefail
cd "$(dirname "$0")/../.."
environment=target/clients
if ! command -v python3 >/dev/null; then
    echo "skipped: no python3 here" >&2
    exit 0
fi
if [ ! -x "$environment/bin/pip" ] && ! python3 -m venv "$environment"; then
    echo "skipped: python3 makes no virtual environments here" >&2
    exit 0
fi
if ! "$environment/bin/pip" install --quiet --timeout 10 --retries 1 --disable-pip-version-check \
    --requirement tests/clients/requirements.txt; then
    echo "skipped: the clients can't be installed from PyPI" >&2
    exit 0
fi
if [ -z "${GONIO:-}" ]; then
    cargo build --locked
    GONIO=target/debug/gonio
fi
GONIO=$(realpath "$GONIO")
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
example=examples/servo-arm
"$environment/bin/python" tests/clients/servos.py \
    "$GONIO" $example/rig.toml $example/scene.toml "$folder/servos"
"$environment/bin/python" tests/clients/meters.py \
    "$GONIO" $example/rig.toml $example/scene.toml "$folder/meter"
"$environment/bin/python" tests/clients/grbl_job.py \
    "$GONIO" examples/lambertian/scene.toml "$folder/grbl"
