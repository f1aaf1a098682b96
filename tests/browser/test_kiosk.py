"""The kiosk page in a real Chromium on a virtual screen: what is shown equals the file, bit for bit."""

import contextlib
import os
import shutil
import struct
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from app.kiosk.screens import KioskScreens, page_of
from app.kiosk.server import serve_kiosk
from drivers.errors import DeviceSettingError

NEEDED = ("chromium", "Xvfb", "matchbox-window-manager")
MISSING = [name for name in NEEDED if shutil.which(name) is None]
pytestmark = pytest.mark.skipif(bool(MISSING), reason=f"not installed: {', '.join(MISSING)}")
COLS, ROWS = 1280, 800


def picture(cols=COLS, rows=ROWS):
    """Random greys: any resampling or colour change shows."""
    return np.random.default_rng(0).integers(0, 256, (rows, cols), dtype=np.uint8)


@contextlib.contextmanager
def running(*command, env=None):
    process = subprocess.Popen(command, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


@contextlib.contextmanager
def virtual_screen():
    """Yield the environment of a screen and the file that holds its pixels (XWD)."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        reading, writing = os.pipe()
        # No pointer: the page hides it, but only once it is moved over the page.
        command = ["Xvfb", "-displayfd", str(writing), "-nocursor", "-fbdir", folder]
        command += ["-screen", "0", f"{COLS}x{ROWS}x24"]
        server = subprocess.Popen(command, pass_fds=[writing], stderr=subprocess.DEVNULL)
        os.close(writing)
        try:
            with os.fdopen(reading) as pipe:
                display = pipe.readline().strip()
            env = {**os.environ, "DISPLAY": f":{display}", "HOME": folder}
            yield env, Path(folder) / "Xvfb_screen0", Path(folder)
        finally:
            server.terminate()
            server.wait()


def screen_pixels(file):
    """Return the screen as (rows, cols, 3) from X's window dump; its header is of 32-bit big-endian words."""
    data = file.read_bytes()
    header = struct.unpack(">25I", data[:100])
    size, colours, stride, rows, cols = header[0], header[19], header[12], header[5], header[4]
    start = size + 12 * colours
    raw = np.frombuffer(data, np.uint8, stride * rows, start).reshape(rows, stride)
    return raw[:, : 4 * cols].reshape(rows, cols, 4)[..., 2::-1]


def browser(url, folder, *options):
    flags = (
        "--no-sandbox",
        "--no-first-run",
        "--disable-gpu",
        "--force-color-profile=srgb",
        "--disable-sync",
    )
    return ("chromium", *flags, f"--user-data-dir={folder}/profile", *options, url)


def test_the_screen_equals_the_file_bit_for_bit():
    sent = picture()
    with virtual_screen() as (env, file, folder):
        screens = KioskScreens(timeout_s=120.0)
        screen = screens.of(0)
        with (
            running("matchbox-window-manager", "-use_titlebar", "no", env=env),
            serve_kiosk(screens) as url,
            running(*browser(url + page_of(0), folder, "--kiosk"), env=env),
        ):
            digest = screen.show(sent)
            assert screen.is_showing(digest)
            deadline_s = time.monotonic() + 100
            while time.monotonic() < deadline_s and not np.array_equal(screen_pixels(file)[..., 0], sent):
                time.sleep(0.1)  # the compositor's own way from the page to the frame buffer
            seen = screen_pixels(file)
            for channel in range(3):
                assert np.array_equal(seen[..., channel], sent)
            with pytest.raises(DeviceSettingError, match="the pattern needs 1024 x 768"):
                screen.show(picture(1024, 768))
            assert not screen.is_showing(digest)
            assert screen.show(sent) == digest


def test_a_window_that_is_not_full_screen_refuses_and_says_which_size_is_wanted():
    with virtual_screen() as (env, _, folder):
        screens = KioskScreens(timeout_s=120.0)
        screen = screens.of(0)
        with (
            serve_kiosk(screens) as url,
            running(*browser(f"--app={url}{page_of(0)}", folder, "--window-size=900,700"), env=env),
            pytest.raises(DeviceSettingError, match=rf"the pattern needs {COLS} x {ROWS}"),
        ):
            screen.show(picture())
