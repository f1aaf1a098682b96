"""What the service says of itself."""

from typing import Literal

from app.api.models.strict import WireModel


class Health(WireModel):
    """The service answers; the rest are the margins that an operator watches."""

    status: Literal["ok", "disk_low"]
    free_disk_bytes: int
    free_memory_bytes: int
    load_per_core: float


class About(WireModel):
    """Versions and the machine."""

    name: Literal["airlens"]
    version: str
    python: str
    machine: str
    cores: int
    data_root: str
