"""The folder of a capture while its frames are taken, so that a crash leaves what was there, marked as incomplete."""

import contextlib
import os
import shutil
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from app.errors import AirlensError, BadInputError
from app.experiment.capture_files import BurstImage, RawStack, write_image
from app.experiment.capture_parts import keep_part, make_whole, note_origin, parts_of
from app.experiment.captures import describe_burst, write_capture
from app.files.durable import make_folder, sync, write_json
from app.files.reading import parse_json
from app.files.toml import to_plain
from drivers.burst import Burst, BurstOutcome, CapturePlan
from drivers.capture import Taken

CHECKPOINT_S = 5.0
_WORTH_KEEPING = ("partial.tif", "manifest.json", "part-*.json")


def reserve(folder: Path, plan: CapturePlan) -> None:
    """Make the folder of a capture that is about to begin: from now on a crash leaves it as an interrupted one.

    Nothing stays when the disk refuses it (OSError). Raises BadInputError when the experiment is gone.
    """
    if not folder.parent.parent.is_dir():
        raise BadInputError(
            f"There is no {folder.parent.parent} any more: nothing can be taken into it. Restore the experiment, "
            "or make another one."
        )
    make_folder(folder.parent)
    folder.mkdir()
    try:
        sync(folder.parent)
        started = datetime.now(UTC).isoformat(timespec="seconds")
        about = {"role": plan.role, "plan": to_plain(plan), "started": started, "process": os.getpid()}
        write_json(folder / "incomplete.json", about)
    except OSError:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def release(folder: Path) -> None:
    """Remove the folder of a capture that never had a frame; any other one stays as it is."""
    with contextlib.suppress(OSError):
        if [path.name for path in folder.iterdir()] == ["incomplete.json"]:
            shutil.rmtree(folder, ignore_errors=True)


class CaptureRecorder:
    """Follows a burst while it runs, so that a crash leaves what was taken before, marked as incomplete.

    Hand `observe` to `run_capture` as `on_frame`; then call `keep` or `discard`.
    """

    def __init__(self, folder: Path, plan: CapturePlan, checkpoint_s: float = CHECKPOINT_S) -> None:
        if not (folder / "incomplete.json").exists():
            reserve(folder, plan)
        self.folder, self._checkpoint_s, self._plan = folder, checkpoint_s, plan
        self._saved_s = float("-inf")
        self._writer = ThreadPoolExecutor(1, "checkpoint")
        self._saving: Future[float] | None = None
        self._stack = RawStack(folder / "frames.tif") if plan.raw_stack else None

    def observe(self, taken: Taken) -> None:
        """Append to the raw stack; renew the moments when their time has come.

        They are written beside the burst: while a disk syncs, a camera fills its buffers.
        """
        if self._stack:
            self._stack.add(taken.frame, taken.record)
        if self._saving is not None:
            if not self._saving.done():
                return
            self._check()
            # At most a tenth of the time goes into checkpoints, however slow the disk.
            self._checkpoint_s = max(self._checkpoint_s, 10 * self._saving.result())
            self._saved_s, self._saving = time.monotonic(), None
        if time.monotonic() - self._saved_s < self._checkpoint_s:
            return
        self._check()
        full_scale, moments = taken.frame.full_scale_counts, taken.moments
        image = BurstImage(moments.mean(full_scale), moments.std(full_scale), moments.frames)
        self._saving = self._writer.submit(self._save, image)

    def keep(self, burst: Burst, origin: Mapping[str, Any] | None = None) -> Path:
        """Finish the folder of a capture of one view. What a device cut short gets no manifest.

        It is no measurement.
        """
        self._close()
        self._check()
        if burst.outcome in (BurstOutcome.COMPLETE, BurstOutcome.ABORTED):
            return write_capture(self.folder, burst, origin=origin)
        return self.keep_short(burst)

    def keep_views(
        self,
        bursts: Mapping[int, Burst],
        names: Sequence[str],
        origin: Mapping[str, Any],
        about: Mapping[str, Any] | None = None,
    ) -> tuple[str, ...]:
        """Keep the whole bursts of a capture of several views, by the view's number; return the names still missing.

        The capture is finished once none is. `about` is kept beside each view.
        """
        self._close()
        self._check()
        (self.folder / "partial.tif").unlink(missing_ok=True)
        for number, burst in bursts.items():
            if burst.outcome is BurstOutcome.COMPLETE:
                keep_part(self.folder, burst, number, names[number], about)
            elif burst.frames:
                self._keep_picture(burst)
        note_origin(self.folder, self._plan, origin)
        parts = parts_of(self.folder, names)
        make_whole(parts)
        return parts.missing

    def keep_short(self, burst: Burst) -> Path:
        """Leave the folder as that of a burst that ended early, with its frames so far."""
        self._close()
        self._check()
        self._keep_picture(burst)
        about = parse_json((self.folder / "incomplete.json").read_bytes(), self.folder, "Take it again.")
        write_json(self.folder / "incomplete.json", about | {"role": burst.plan.role} | describe_burst(burst))
        return self.folder

    def discard(self) -> None:
        """Remove the folder and what was taken."""
        self._close()
        shutil.rmtree(self.folder)

    def leave(self) -> None:
        """End without a burst: frames stay as an interrupted capture; where there are none, nothing stays."""
        self._close()
        if not any(path for name in _WORTH_KEEPING for path in self.folder.glob(name)):
            shutil.rmtree(self.folder, ignore_errors=True)

    def _keep_picture(self, burst: Burst) -> None:
        write_image(self.folder / "partial.tif", BurstImage(burst.mean, burst.std, burst.frames))

    def _check(self) -> None:
        """Raise AirlensError when somebody has removed the folder: what is written now would be of no use."""
        if not (self.folder / "incomplete.json").exists():
            raise AirlensError(
                f"The folder {self.folder} was removed while its capture was taken; nothing of it is kept. "
                "Take it again."
            )

    def _save(self, image: BurstImage) -> float:
        """Write a checkpoint; return how long that took [s]."""
        began_s = time.monotonic()
        write_image(self.folder / "partial.tif", image)
        return time.monotonic() - began_s

    def _close(self) -> None:
        self._writer.shutdown()  # what a last checkpoint could not write, the burst's end cannot either, and says so
        if self._stack:
            self._stack.close()
            self._stack = None
