"""An independent client drives the simulated servos: dynamixel-sdk, the maker's own, from PyPI.

It pings, reads and writes single servos and several at once, moves them, and meets the errors
that a real servo answers with. Run by tests/clients/run.sh.
"""

import subprocess
import sys
import time

from dynamixel_sdk import (
    COMM_SUCCESS,
    GroupBulkRead,
    GroupSyncRead,
    GroupSyncWrite,
    PacketHandler,
    PortHandler,
)

BAUD = 1_000_000
IDS = [1, 2, 3, 4]
OPERATING_MODE, TORQUE_ENABLE, HARDWARE_ERROR, BUS_WATCHDOG = 11, 64, 70, 98
PROFILE_ACCELERATION, PROFILE_VELOCITY, GOAL_POSITION = 108, 112, 116
MOVING, PRESENT_POSITION = 122, 132
ACCESS_ERROR, DATA_RANGE_ERROR, DATA_LIMIT_ERROR = 7, 4, 6


def main(gonio: str, rig: str, scene: str, link: str) -> None:
    arguments = ["--rig", rig, "--scene", scene, "--as", "dynamixel", "--pty", link]
    sim = subprocess.Popen([gonio, "sim", *arguments], stdout=subprocess.PIPE, text=True)
    try:
        assert sim.stdout.readline().strip() == link
        drive(link)
    finally:
        sim.terminate()
        sim.wait()
    print("dynamixel-sdk: the simulated servos answer as the maker's client expects")


def drive(link: str) -> None:
    port, packets = PortHandler(link), PacketHandler(2.0)
    assert port.openPort() and port.setBaudRate(BAUD)
    try:
        who_is_there(port, packets)
        what_is_refused(port, packets)
        together(port, packets)
        moves(port, packets)
        watchdog(port, packets)
    finally:
        port.closePort()


def ok(answer: tuple) -> int:
    """The value of a read; any error of line or servo fails."""
    *value, line, error = answer
    assert line == COMM_SUCCESS and error == 0, answer
    return value[0] if value else 0


def who_is_there(port, packets) -> None:
    for number in IDS:
        assert ok(packets.ping(port, number)) == 1030, "an XM430-W210"
    found, line = packets.broadcastPing(port)
    assert line == COMM_SUCCESS and sorted(set(found) - {5}) == IDS, (found, line)
    _, line, _ = packets.ping(port, 77)
    assert line != COMM_SUCCESS, "nobody has this number"


def what_is_refused(port, packets) -> None:
    ok(packets.write1ByteTxRx(port, 1, TORQUE_ENABLE, 1))
    line, error = packets.write1ByteTxRx(port, 1, OPERATING_MODE, 1)
    assert (line, error) == (COMM_SUCCESS, ACCESS_ERROR), "not while its torque is on"
    line, error = packets.write4ByteTxRx(port, 1, GOAL_POSITION, 5000)
    assert (line, error) == (COMM_SUCCESS, DATA_LIMIT_ERROR), "beyond its turn"
    line, error = packets.write4ByteTxRx(port, 1, PRESENT_POSITION, 0)
    assert (line, error) == (COMM_SUCCESS, ACCESS_ERROR), "to be read only"
    assert ok(packets.read1ByteTxRx(port, 1, HARDWARE_ERROR)) == 0


def together(port, packets) -> None:
    group = GroupSyncRead(port, packets, PRESENT_POSITION, 4)
    assert all(group.addParam(number) for number in IDS)
    for read in (group.txRxPacket, group.fastSyncRead):
        assert read() == COMM_SUCCESS, read
        for number in IDS:
            alone = ok(packets.read4ByteTxRx(port, number, PRESENT_POSITION))
            assert group.getData(number, PRESENT_POSITION, 4) == alone, (read, number)
    bulk = GroupBulkRead(port, packets)
    assert bulk.addParam(1, PRESENT_POSITION, 4) and bulk.addParam(2, MOVING, 1)
    assert bulk.txRxPacket() == COMM_SUCCESS
    assert bulk.getData(2, MOVING, 1) == 0
    # A value that has to be stuffed.
    ok(packets.write1ByteTxRx(port, 2, TORQUE_ENABLE, 0))
    line, error = packets.write4ByteTxRx(port, 2, PROFILE_VELOCITY, 0x00FDFFFF)
    assert (line, error) == (COMM_SUCCESS, DATA_LIMIT_ERROR), "understood, and too fast"


def moves(port, packets) -> None:
    for number in IDS:
        ok(packets.write4ByteTxRx(port, number, PROFILE_VELOCITY, 200))
        ok(packets.write4ByteTxRx(port, number, PROFILE_ACCELERATION, 40))
        ok(packets.write1ByteTxRx(port, number, TORQUE_ENABLE, 1))
    goals = {1: 2300, 2: 1800, 3: 2100, 4: 2000}
    group = GroupSyncWrite(port, packets, GOAL_POSITION, 4)
    for number, goal in goals.items():
        assert group.addParam(number, list(goal.to_bytes(4, "little")))
    assert group.txPacket() == COMM_SUCCESS
    deadline = time.monotonic() + 20
    for number, goal in goals.items():
        while abs(ok(packets.read4ByteTxRx(port, number, PRESENT_POSITION)) - goal) > 1:
            assert time.monotonic() < deadline, (number, goal)
            time.sleep(0.02)


def watchdog(port, packets) -> None:
    ok(packets.write1ByteTxRx(port, 1, BUS_WATCHDOG, 10))
    time.sleep(0.5)
    assert ok(packets.read1ByteTxRx(port, 1, BUS_WATCHDOG)) == 0xFF, "it has struck: -1"
    line, error = packets.write4ByteTxRx(port, 1, GOAL_POSITION, 2000)
    assert (line, error) == (COMM_SUCCESS, DATA_RANGE_ERROR), "until it is cleared"
    ok(packets.write1ByteTxRx(port, 1, BUS_WATCHDOG, 0))
    ok(packets.write4ByteTxRx(port, 1, GOAL_POSITION, 2000))


if __name__ == "__main__":
    main(*sys.argv[1:5])
