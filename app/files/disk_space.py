"""Is there room for a burst, on disk and in memory, before it begins?"""

import shutil
from pathlib import Path

import psutil

from app.errors import AirlensError
from drivers.burst import CapturePlan
from drivers.protocols import CameraInfo

RESERVE_BYTES = 500_000_000


def check_room(folder: Path, plan: CapturePlan, camera: CameraInfo) -> None:
    """Return when disk and memory suffice. Raises AirlensError that says how much is missing."""
    pixels = camera.width_px * camera.height_px
    raw = pixels * (1 if camera.bits <= 8 else 2)
    on_disk = 16 * pixels + (plan.frames * raw if plan.raw_stack else 0)
    free = shutil.disk_usage(_existing(folder)).free
    if on_disk + RESERVE_BYTES > free:
        raise AirlensError(
            f"The capture needs {on_disk / 1e9:.1f} GB on disk; {free / 1e9:.1f} GB are free and "
            f"{RESERVE_BYTES / 1e9:.1f} GB are held in reserve. "
            "Free some, take fewer frames, or drop the raw stack."
        )
    # Two sums in float64, two images in float32, four buffers of the driver and a frame in hand.
    in_memory = 24 * pixels + 5 * raw
    available = psutil.virtual_memory().available
    if in_memory > available:
        raise AirlensError(
            f"The capture needs {in_memory / 1e9:.1f} GB of memory; {available / 1e9:.1f} GB are available. "
            "Close other programs, or choose a smaller image."
        )


def _existing(folder: Path) -> Path:
    return next(p for p in (folder, *folder.absolute().parents) if p.exists())
