"""Controls of a camera by name, with range and flags; every setting is read back.

A driver clamps a value, or ignores it while an automatic is on, and reports success all the same.
"""

from dataclasses import dataclass

from drivers.errors import DeviceError, DeviceSettingError
from drivers.v4l2 import abi
from drivers.v4l2.node import Node

AUTOMATICS = {
    abi.CID_EXPOSURE_AUTO: abi.EXPOSURE_MANUAL,
    abi.CID_AUTOGAIN: 0,
    abi.CID_AUTO_WHITE_BALANCE: 0,
    abi.CID_EXPOSURE_AUTO_PRIORITY: 0,
    abi.CID_FOCUS_AUTO: 0,
    abi.CID_HUE_AUTO: 0,
    abi.CID_AUTOBRIGHTNESS: 0,
}


@dataclass(frozen=True)
class ControlDescription:
    """A control as the driver offers it. `inactive` means that an automatic has it."""

    identifier: int
    name: str
    kind: str
    minimum: int
    maximum: int
    step: int
    default: int
    read_only: bool
    inactive: bool


class Controls:
    """The controls of one open node."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self.descriptions = {item.name: item for item in self._enumerate()}

    def has(self, identifier: int) -> bool:
        """Return whether the camera has this control."""
        return any(item.identifier == identifier for item in self.descriptions.values())

    def named(self, name: str) -> ControlDescription:
        """Return a control by name. Raises DeviceSettingError that lists the names."""
        if name not in self.descriptions:
            known = ", ".join(sorted(self.descriptions))
            raise DeviceSettingError(f"The camera has no control {name!r}. Choose one of: {known}.")
        return self.descriptions[name]

    def get(self, identifier: int) -> int:
        """Return the present value."""
        control = abi.Control(id=identifier)
        self._node.call(abi.VIDIOC_G_CTRL, control)
        return control.value

    def set(self, identifier: int, value: int) -> int:
        """Set a value and return what was granted. Raises DeviceSettingError when that differs."""
        item = next(d for d in self.descriptions.values() if d.identifier == identifier)
        allowed = f"{item.minimum} to {item.maximum} in steps of {item.step}"
        try:
            self._node.call(abi.VIDIOC_S_CTRL, abi.Control(id=identifier, value=value))
        except DeviceSettingError as error:
            raise DeviceSettingError(f"{item.name} = {value} was refused; expected {allowed}.") from error
        granted = self.get(identifier)
        if granted != value:
            automatic = " An automatic control has it: switch that off first." if item.inactive else ""
            raise DeviceSettingError(
                f"{item.name} is {granted} after {value} was set; expected {allowed}.{automatic}"
            )
        return granted

    def press(self, name: str) -> None:
        """Press a button: it has no value to read back."""
        self._node.call(abi.VIDIOC_S_CTRL, abi.Control(id=self.named(name).identifier, value=1))

    def values(self) -> dict[str, int]:
        """Return every readable value by name, as the driver has it now."""
        found = {}
        for name, item in self.descriptions.items():
            if item.kind == "button":
                continue
            try:
                found[name] = self.get(item.identifier)
            except DeviceSettingError:
                continue  # write-only, or not readable at this moment
        return found

    def switch_automatics_off(self) -> dict[str, int]:
        """Switch every automatic off that this camera has, verified; return what was set."""
        done = {}
        for item in self.descriptions.values():
            wanted = AUTOMATICS.get(item.identifier)
            if wanted is not None and not item.read_only:
                done[item.name] = self.set(item.identifier, wanted)
        self.descriptions = {item.name: item for item in self._enumerate()}
        return done

    def _enumerate(self) -> list[ControlDescription]:
        found, identifier = [], 0
        while True:
            item = abi.QueryCtrl(id=identifier | abi.CTRL_FLAG_NEXT_CTRL)
            try:
                self._node.call(abi.VIDIOC_QUERYCTRL, item)
            except DeviceSettingError:
                return found
            except DeviceError:
                raise
            identifier = item.id
            if item.type in abi.CTRL_TYPES and not item.flags & abi.CTRL_FLAG_DISABLED:
                found.append(_describe(item))


def _describe(item: abi.QueryCtrl) -> ControlDescription:
    text = item.name.decode("utf-8", "replace").lower()
    name = "_".join("".join(c if c.isalnum() else " " for c in text).split())
    return ControlDescription(
        item.id,
        name,
        abi.CTRL_TYPES[item.type],
        item.minimum,
        item.maximum,
        item.step,
        item.default_value,
        bool(item.flags & abi.CTRL_FLAG_READ_ONLY),
        bool(item.flags & abi.CTRL_FLAG_INACTIVE),
    )
