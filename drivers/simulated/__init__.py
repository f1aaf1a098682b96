"""Simulated twins of the devices, behind the same Protocols. Used by `app.rig.open` and tests only."""

from drivers.simulated.camera import SimulatedCamera as SimulatedCamera
from drivers.simulated.clock import VirtualClock as VirtualClock
from drivers.simulated.display import SimulatedDisplay as SimulatedDisplay
from drivers.simulated.faults import CameraFault as CameraFault
from drivers.simulated.sensor import SensorNoise as SensorNoise
