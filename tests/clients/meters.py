"""Independent clients read the simulated meters: ThorlabsPM100 the power meter, and pyvisa-py the
picoammeter in the words of its manual, all from PyPI. Run by tests/clients/run.sh.
"""

import subprocess
import sys

import pyvisa
from ThorlabsPM100 import ThorlabsPM100


def main(gonio: str, rig: str, scene: str, link: str) -> None:
    with Sim(gonio, rig, scene, "thorlabs", link):
        power = power_meter(link)
    with Sim(gonio, rig, scene, "keithley", link):
        current = picoammeter(link)
    # Both look at the same spot in the same light.
    assert abs(power / current - 1) < 0.01, (power, current)
    print(f"ThorlabsPM100 and pyvisa-py read {power:.6e} W and {current:.6e} A of the same light")


class Sim:
    """A simulated meter, as long as it is looked at."""

    def __init__(self, gonio, rig, scene, make, link):
        arguments = ["--rig", rig, "--scene", scene, "--as", make, "--pty", link]
        self.command, self.link = [gonio, "sim", *arguments], link

    def __enter__(self):
        self.sim = subprocess.Popen(self.command, stdout=subprocess.PIPE, text=True)
        assert self.sim.stdout.readline().strip() == self.link

    def __exit__(self, *_):
        self.sim.terminate()
        self.sim.wait()


def power_meter(link: str) -> float:
    manager = pyvisa.ResourceManager("@py")
    resource = manager.open_resource(f"ASRL{link}::INSTR", read_termination="\n")
    resource.write_termination, resource.timeout = "\n", 5000
    meter = ThorlabsPM100(inst=resource)
    assert "PM100D" in resource.query("*IDN?")
    meter.sense.correction.wavelength = 532
    assert abs(meter.sense.correction.wavelength - 532) < 1e-6
    meter.sense.average.count = 5
    assert meter.sense.average.count == 5
    meter.sense.power.dc.range.auto = "ON"
    assert meter.sense.power.dc.unit.strip() == "W"
    power = meter.read
    assert resource.query("SYST:ERR?").startswith("0,")
    resource.close()
    return power


def picoammeter(link: str) -> float:
    manager = pyvisa.ResourceManager("@py")
    resource = manager.open_resource(f"ASRL{link}::INSTR", read_termination="\r")
    resource.write_termination, resource.timeout = "\r", 5000
    assert "MODEL 6485" in resource.query("*IDN?")
    # As its manual zeroes it and reads.
    for word in ("*RST", "SYST:ZCH ON", "RANG 2e-9", "INIT"):
        resource.write(word)
    assert resource.query("*OPC?") == "1"
    for word in ("SYST:ZCOR:ACQ", "SYST:ZCOR ON", "RANG:AUTO ON", "SYST:ZCH OFF"):
        resource.write(word)
    resource.write("FORM:ELEM READ;:TRIG:COUN 5")
    readings = resource.query_ascii_values("READ?", converter=lambda text: float(text.rstrip("A")))
    assert len(readings) == 5 and max(readings) < 9e37, readings
    assert resource.query("SYST:ERR?").startswith("0,")
    # What does not fit its range is the manual's number for it.
    resource.write("RANG:AUTO OFF;:RANG 2e-9;:TRIG:COUN 1")
    assert float(resource.query("READ?").rstrip("A")) == 9.9e37
    resource.write("NONSENSE 1")
    assert resource.query("SYST:ERR?").startswith("-113")
    resource.close()
    return sum(readings) / len(readings)


if __name__ == "__main__":
    main(*sys.argv[1:5])
