"""An independent client runs a job on the simulated grbl: grbl-streamer, from PyPI.

The client homes the board, streams lines by counting characters, and reads positions; what it
sees must be what grbl would show it. Run by tests/clients/run.sh.
"""

import subprocess
import sys
import threading
import time

from grbl_streamer import GrblStreamer

PATIENCE_S = 120
LINES = 90


def main(gonio: str, scene: str, link: str) -> None:
    sim = subprocess.Popen(
        [gonio, "sim", "--scene", scene, "--as", "grbl", "--pty", link],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert sim.stdout.readline().strip() == link
        stream_job(link)
    finally:
        sim.terminate()
        sim.wait()


def stream_job(link: str) -> None:
    finished, booted, errors, alarms = threading.Event(), threading.Event(), [], []

    def hear(event, *data):
        if event == "on_job_completed":
            finished.set()
        elif event == "on_boot":
            booted.set()
        elif event == "on_error":
            errors.append(data)
        elif event == "on_alarm":
            alarms.append(data)

    grbl = GrblStreamer(hear)
    grbl.setup_logging()
    grbl.cnect(link, 115200)
    assert booted.wait(PATIENCE_S), "the client saw no banner"
    grbl.poll_start()
    try:
        wait_for(lambda: grbl.cmode == "Alarm", "locked after boot")
        grbl.homing()
        wait_for(lambda: grbl.cmode == "Idle" and near(grbl.cmpos, (-2, -2, -2)), "homed")
        # More lines, and longer ones, than buffer and planner hold together.
        grbl.incremental_streaming = False
        for n in range(LINES):
            y = -20.0 - (n % 7)
            grbl.write(f"G1 X{-20 - n % 10:.4f} Y{y:.4f} Z-20.0000 F6000.0")
        grbl.write("G0 X-30.5000 Y-40.2500 Z-50.1250")
        grbl.job_run()
        assert finished.wait(PATIENCE_S), f"the job did not end: {errors} {alarms}"
        wait_for(
            lambda: grbl.cmode == "Idle" and near(grbl.cmpos, (-30.5, -40.25, -50.125)),
            "at the end of the job", lambda: (grbl.cmode, grbl.cmpos, errors, alarms),
        )
        assert not errors and not alarms, (errors, alarms)
    finally:
        grbl.poll_stop()
        grbl.disconnect()
    print(f"grbl-streamer: {LINES + 1} lines streamed, none refused, at {grbl.cmpos}")


def near(found, expected) -> bool:
    return all(abs(a - b) < 0.0015 for a, b in zip(found, expected))


def wait_for(is_so, what: str, found=lambda: "") -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < deadline, f"never {what}: {found()}"
        time.sleep(0.05)


if __name__ == "__main__":
    main(*sys.argv[1:4])
