"""Independent clients drive our simulated projectors, by terminal and TCP, and read what ours read."""

import asyncio
import gc

import pytest

from drivers.clock import SystemClock
from drivers.projector.lamp_guard import LampGuard
from drivers.projector.link import ProjectorLink
from drivers.projector.pjlink_port import PjLinkPort
from drivers.projector.port import SerialPort, TcpPort
from drivers.projector.protocol import PowerState
from drivers.simulated.projector.hosts import PtyHost, TcpHost
from tests.drivers.projector.twins import DIALECTS, make_twin
from tests.run_async import run_async

pytestmark = pytest.mark.filterwarnings("ignore")  # of the clients


def real_twin(name, **options):
    twin = make_twin(name, clock=SystemClock(), **options)
    twin.responder.state.warm_up_s = twin.responder.state.cool_down_s = 0.2
    return twin


class Recorder:
    """Keeps what a client sends."""

    def __init__(self, twin):
        self.sent = b""
        feed = twin.feed

        def listen(data):
            self.sent += data
            feed(data)

        twin.feed = listen


def ours(name, path):
    port = SerialPort(str(path))
    return ProjectorLink(DIALECTS[name][0](), port, guard=LampGuard(0.0, 0.0))


def test_epson_projector_drives_our_epson(tmp_path):
    from epson_projector import Projector
    from epson_projector.const import SERIAL

    async def drive(path):
        projector = Projector(str(path), type=SERIAL)
        found = [await projector.get_power()]
        await projector.send_command("PWR ON")
        await asyncio.sleep(0.4)
        projector._lock._isLocked = False
        found += [await projector.get_property("PWR", 5), await projector.get_property("SOURCE", 5)]
        found.append(await projector.get_serial_number())
        projector.close()
        return found

    twin = real_twin("escvp21")
    recorder = Recorder(twin)
    with PtyHost(twin, tmp_path / "epson") as host:
        assert run_async(drive(host.path)) == ["00", "01", "30", "TWIN-1"]
        theirs, recorder.sent = recorder.sent, b""
        with ours("escvp21", host.path) as link:
            assert link.status().source == "30"
    # Byte for byte the same questions, up to the null command that greets.
    for question in (b"PWR?\r", b"SOURCE?\r", b"SNO?\r"):
        assert question in theirs
        assert question in recorder.sent


def test_benqprojector_drives_our_benq(tmp_path):
    from benqprojector import BenQProjectorSerial

    async def drive(path):
        projector = BenQProjectorSerial(str(path), 9600)
        assert await projector.connect()
        found = [projector.power_status, projector.model]
        projector._poweron_time = 0.1  # it trusts its table of models, not the answer
        assert await projector.turn_on()
        await asyncio.sleep(0.4)
        await projector.update_power()
        found.append(projector.power_status)
        await projector.update_video_source()
        found.append(projector.video_source)
        await projector.disconnect()
        return found

    twin = real_twin("benq")
    recorder = Recorder(twin)
    with PtyHost(twin, tmp_path / "benq") as host:
        assert run_async(drive(host.path)) == [0, "TWIN-1", 2, "hdmi"]
        theirs, recorder.sent = recorder.sent, b""
        with ours("benq", host.path) as link:
            assert link.power() is PowerState.ON
            assert link.status().source == "HDMI"
    for question in (b"*pow=?#\r", b"*modelname=?#\r", b"*sour=?#\r"):
        assert question in theirs
        assert question in recorder.sent


@pytest.mark.parametrize("password", ["", "JBMIAProjectorLink"])
def test_aiopjlink_drives_our_pjlink(password):
    from aiopjlink import PJLink, PJLinkPassword

    async def drive(port, secret):
        async with PJLink("127.0.0.1", port=port, password=secret) as link:
            found = [(await link.power.get()).name]
            await link.power.turn_on()
            await asyncio.sleep(0.4)
            found += [
                (await link.power.get()).name,
                await link.info.projector_name(),
                await link.lamps.hours(),
            ]
            return found

    twin = real_twin("pjlink", password=password)
    recorder = Recorder(twin)
    with TcpHost(twin) as host:
        assert run_async(drive(host.port, password))[:3] == ["OFF", "ON", "TWIN-1"]
        theirs, recorder.sent = recorder.sent, b""
        port = PjLinkPort(TcpPort("127.0.0.1", host.port), password)
        with ProjectorLink(DIALECTS["pjlink"][0](), port) as link:
            assert link.status().name == "TWIN-1"
        for question in (b"%1POWR ?\r", b"%1NAME ?\r", b"%1LAMP ?\r"):
            assert question in theirs
            assert question in recorder.sent
        if password:
            with pytest.raises(PJLinkPassword):
                run_async(drive(host.port, "wrong"))
            gc.collect()  # the client leaves its socket to the collector; let that be here
