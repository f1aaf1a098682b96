"""One viewer of the live picture: gets the newest frame for every credit; none is ever queued."""

import asyncio
import itertools
import math
from typing import Self

from app.rig.frame_statistics import LiveFrame
from app.rig.live_camera import LiveCamera

MOST_CREDITS = 8.0
KEYS = itertools.count(1)


class Viewer:
    """Watches `camera` inside `async with`; without credits of its own it takes every frame it can."""

    def __init__(self, camera: LiveCamera, stretch: bool = False, credits: float = math.inf) -> None:
        self.stretch = stretch
        self._camera = camera
        self._key = next(KEYS)
        self._credits = credits
        self._closed = False
        self._newest: LiveFrame | None = None
        self._changed = asyncio.Event()

    async def __aenter__(self) -> Self:
        loop = asyncio.get_running_loop()

        def heard(frame: LiveFrame) -> None:
            self._newest = frame
            loop.call_soon_threadsafe(self._changed.set)

        self._camera.watch(self._key, heard, self.stretch)
        return self

    async def __aexit__(self, *exception: object) -> None:
        self._camera.leave(self._key)

    def ask(self, credits: int, stretch: bool) -> None:
        """Take note of what the viewer can swallow and how it wants to see."""
        self._credits = min(MOST_CREDITS, self._credits + max(0, credits))
        self.stretch = stretch
        self._camera.stretch(self._key, stretch)
        self._changed.set()

    def close(self) -> None:
        """Let `next_frame` return None."""
        self._closed = True
        self._changed.set()

    async def next_frame(self) -> LiveFrame | None:
        """Return the newest frame that was not shown yet, once there is a credit; None after `close`."""
        while not self._closed:
            frame = self._newest
            if frame is not None and self._credits >= 1:
                self._newest = None
                self._credits -= 1
                return frame
            await self._changed.wait()
            self._changed.clear()
        return None
