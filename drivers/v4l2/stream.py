"""The ring of buffers that the driver fills: mapped once, dequeued with a time limit of our own."""

import ctypes
import errno
import fcntl
import mmap
import select
import time
from dataclasses import dataclass

import numpy as np

from drivers.errors import DeviceNotFoundError, DeviceTimeoutError
from drivers.v4l2 import abi
from drivers.v4l2.node import Node, explain

# A machine that is busy for a moment loses no frame while the ring has room: so many buffers, within this memory.
MOST_BUFFERS, LEAST_BUFFERS = 32, 4
RING_BYTES = 256e6


@dataclass(frozen=True)
class Filled:
    """A filled buffer; `data` is ours (a copy), the buffer itself is back in the ring."""

    data: np.ndarray
    sequence: int
    timestamp_s: float
    flags: int

    @property
    def monotonic(self) -> bool:
        """Whether the timestamp is on the machine's monotonic clock."""
        return self.flags & abi.BUF_FLAG_TIMESTAMP_MASK == abi.BUF_FLAG_TIMESTAMP_MONOTONIC

    @property
    def at_start(self) -> bool:
        """Whether the timestamp marks the start of the exposure, not the end of the frame."""
        return self.flags & abi.BUF_FLAG_TSTAMP_SRC_MASK == abi.BUF_FLAG_TSTAMP_SRC_SOE


class Stream:
    """A running capture stream; made running, ended by `close`."""

    def __init__(self, node: Node, frame_bytes: int) -> None:
        self._node = node
        count = buffers_for(frame_bytes)
        request = abi.RequestBuffers(count=count, type=abi.BUF_TYPE_VIDEO_CAPTURE, memory=abi.MEMORY_MMAP)
        node.call(abi.VIDIOC_REQBUFS, request)
        self._maps: list[mmap.mmap] = []
        try:
            for index in range(request.count):
                buffer = self._buffer(index)
                node.call(abi.VIDIOC_QUERYBUF, buffer)
                self._maps.append(mmap.mmap(node.descriptor, buffer.length, offset=buffer.offset))
            self._run()
        except BaseException:
            self.close()
            raise

    def restart(self) -> None:
        """Throw away what is in the ring and start anew."""
        self._node.call(abi.VIDIOC_STREAMOFF, ctypes.c_int32(abi.BUF_TYPE_VIDEO_CAPTURE))
        self._run()

    def dequeue(self, timeout_s: float) -> Filled:
        """Return the next filled buffer. Raises DeviceTimeoutError; DeviceNotFoundError when it is gone."""
        deadline_s = time.monotonic() + timeout_s
        poll = select.poll()
        poll.register(self._node.descriptor, select.POLLIN)
        while True:
            left_s = deadline_s - time.monotonic()
            events = poll.poll(max(0.0, left_s) * 1000)
            buffer = self._buffer(0)
            if events and self._try_dequeue(buffer):
                return self._take(buffer)
            if left_s <= 0:
                self._raise_silence(timeout_s)
            if events and events[0][1] & (select.POLLERR | select.POLLHUP):
                time.sleep(0.005)  # an error state that is not yet an unplug: do not spin

    def close(self) -> None:
        """Stop, and give the buffers back. Safe after an unplug."""
        for request, argument in (
            (abi.VIDIOC_STREAMOFF, ctypes.c_int32(abi.BUF_TYPE_VIDEO_CAPTURE)),
            (
                abi.VIDIOC_REQBUFS,
                abi.RequestBuffers(count=0, type=abi.BUF_TYPE_VIDEO_CAPTURE, memory=abi.MEMORY_MMAP),
            ),
        ):
            if request == abi.VIDIOC_REQBUFS:
                while self._maps:
                    self._maps.pop().close()
            try:
                fcntl.ioctl(self._node.descriptor, request, argument)
            except OSError:
                continue  # the device is gone: nothing is left to stop

    def _run(self) -> None:
        for index in range(len(self._maps)):
            self._node.call(abi.VIDIOC_QBUF, self._buffer(index))
        self._node.call(abi.VIDIOC_STREAMON, ctypes.c_int32(abi.BUF_TYPE_VIDEO_CAPTURE))

    def _try_dequeue(self, buffer: abi.Buffer) -> bool:
        try:
            fcntl.ioctl(self._node.descriptor, abi.VIDIOC_DQBUF, buffer)
        except OSError as error:
            if error.errno == errno.EAGAIN:
                return False
            raise explain(error, self._node.path) from error
        return True

    def _take(self, buffer: abi.Buffer) -> Filled:
        data = np.frombuffer(self._maps[buffer.index], np.uint8, buffer.bytesused).copy()
        filled = Filled(data, buffer.sequence, buffer.seconds + buffer.microseconds * 1e-6, buffer.flags)
        self._node.call(abi.VIDIOC_QBUF, self._buffer(buffer.index))
        return filled

    def _raise_silence(self, timeout_s: float) -> None:
        if not self._node.path.exists():
            raise DeviceNotFoundError(f"{self._node.path} was unplugged. Plug it in; it is found again.")
        raise DeviceTimeoutError(
            f"{self._node.path} sent no frame within {timeout_s:g} s. "
            "Check the cable, and that no trigger mode is on; then take the burst again."
        )

    @staticmethod
    def _buffer(index: int) -> abi.Buffer:
        return abi.Buffer(index=index, type=abi.BUF_TYPE_VIDEO_CAPTURE, memory=abi.MEMORY_MMAP)


def buffers_for(frame_bytes: int) -> int:
    """Return how many buffers are asked for; the driver may give fewer."""
    return int(min(MOST_BUFFERS, max(LEAST_BUFFERS, RING_BYTES // max(frame_bytes, 1))))
