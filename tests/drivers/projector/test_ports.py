"""The line itself: exclusive, limited in time, and every way to lose it made one error."""

import time

import pytest

from drivers.clock import SystemClock
from drivers.errors import DeviceBusyError, DeviceNotFoundError
from drivers.projector.port import SerialPort, TcpPort
from drivers.projector.protocol import PowerState
from drivers.simulated.projector.engine import ProjectorFault
from drivers.simulated.projector.hosts import PtyHost, TcpHost
from tests.drivers.projector.test_third_parties import ours
from tests.drivers.projector.twins import make_twin


def test_a_second_opener_is_told_that_the_line_is_in_use(tmp_path):
    with PtyHost(make_twin("escvp21", clock=SystemClock()), tmp_path / "port") as host:
        first, second = SerialPort(str(host.path)), SerialPort(str(host.path))
        first.open()
        with pytest.raises(DeviceBusyError, match="in use"):
            second.open()
        first.close()
        second.open()
        second.close()


def test_reading_ends_in_its_time(tmp_path):
    with PtyHost(make_twin("escvp21", clock=SystemClock()), tmp_path / "port") as host:
        port = SerialPort(str(host.path))
        port.open()
        began_s = time.monotonic()
        assert port.read(0.1) == b""
        assert 0.09 <= time.monotonic() - began_s < 30.0
        port.close()


@pytest.mark.parametrize("name", ["escvp21", "benq"])
def test_a_pulled_adapter_is_one_error_and_is_found_again(tmp_path, name):
    faults = {1: ProjectorFault.HANG_UP, 2: ProjectorFault.HANG_UP}
    if name == "benq":
        faults = {2: ProjectorFault.HANG_UP, 4: ProjectorFault.HANG_UP}
    twin = make_twin(name, faults.get, clock=SystemClock())
    with PtyHost(twin, tmp_path / "port") as host, ours(name, host.path) as link:
        assert link.power() is PowerState.STANDBY
        states = []
        deadline_s = time.monotonic() + 120
        while len(states) < 4 or (states[-1] is not PowerState.STANDBY and time.monotonic() < deadline_s):
            try:
                states.append(link.power())
            except DeviceNotFoundError as error:
                states.append(str(error))
            time.sleep(0.05)
        assert states[-1] is PowerState.STANDBY
        assert any("lost" in str(entry) for entry in link.log.entries)


def test_what_is_not_there_is_said(tmp_path):
    with pytest.raises(DeviceNotFoundError, match="cannot be opened"):
        SerialPort(str(tmp_path / "nothing")).open()
    with TcpHost(make_twin("optoma", clock=SystemClock())) as host:
        number = host.port
    with pytest.raises(DeviceNotFoundError, match="cannot be opened"):
        TcpPort("127.0.0.1", number).open()
