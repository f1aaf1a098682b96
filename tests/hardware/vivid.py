"""What our V4L2 layer sees of the kernel's own virtual camera; run inside the machine that has it (README).

Prints one JSON line a check with what was found; exit status 1 when any failed.
"""

import json
import sys
import threading
import time
import traceback
from collections import Counter
from pathlib import Path

import numpy as np

from drivers.burst import BurstOutcome, CapturePlan
from drivers.capture import run_capture
from drivers.errors import (
    DeviceBusyError,
    DeviceError,
    DeviceNotFoundError,
    DeviceSettingError,
    DeviceTimeoutError,
    FrameError,
)
from drivers.v4l2 import V4l2Camera, V4l2Request, abi, list_devices

DEVICE = Path(sys.argv[1] if len(sys.argv) > 1 else "/dev/video0")
SIZE = (640, 360)


def request(code="GREY", **options):
    return V4l2Request(DEVICE, *SIZE, pixel_format=code, **options)


def refused(action, *kinds):
    try:
        action()
    except kinds as error:
        return f"{type(error).__name__}: {error}"
    raise RuntimeError(f"expected {kinds}")


def good(action):
    """Return the next good frame: a slow machine loses some, and each is refused as it should be."""
    for _ in range(100):
        try:
            return action()
        except FrameError:
            continue
    raise RuntimeError("a hundred frames refused in a row")


def enumerates():
    found = {d.path: d for d in list_devices()}[DEVICE]
    codes = [f.code for f in found.formats]
    assert {"GREY", "Y16", "YUYV"} <= set(codes), codes
    grey = next(f for f in found.formats if f.code == "GREY")
    assert any((s.width_px, s.height_px) == SIZE and s.rates_hz for s in grey.sizes)
    gain = next(c for c in found.controls if c.name == "gain")
    return {
        "name": found.name,
        "formats": len(codes),
        "controls": len(found.controls),
        "gain": [gain.minimum, gain.maximum],
    }


def captures_exact_types():
    found = {}
    for code, dtype, full in (
        ("GREY", "uint8", 255),
        ("Y10", "uint16", 1023),
        ("Y12", "uint16", 4095),
        ("Y16", "uint16", 65535),
        ("YUYV", "uint8", 255),
        ("NV12", "uint8", 255),
    ):
        try:
            with V4l2Camera(request(code)) as camera:
                frames = [good(camera.grab), good(camera.follow)]
        except DeviceSettingError as error:
            found[code] = str(error)
            continue
        for frame in frames:
            assert frame.pixels.dtype == dtype, (code, frame.pixels.dtype)
            assert frame.pixels.shape == SIZE[::-1]
            assert frame.full_scale_counts == full
        found[code] = {"dtype": dtype, "max": int(frames[0].pixels.max())}
    assert all(isinstance(found[code], dict) for code in ("GREY", "Y16", "YUYV")), found
    return found


def grey_is_the_top_byte_of_y16():
    """The colour bars stand still: the same rows in three formats must agree bit for bit."""
    rows = {}
    for code in ("GREY", "Y16", "YUYV"):
        with V4l2Camera(request(code)) as camera:
            rows[code] = good(camera.grab).pixels[SIZE[1] // 2]
    high = (rows["Y16"] >> 8).astype(np.uint8)
    return {
        "grey_equals_y16_high_byte": bool(np.array_equal(rows["GREY"], high)),
        "levels_grey": np.unique(rows["GREY"]).tolist(),
        "levels_y16": np.unique(rows["Y16"]).tolist(),
        "levels_yuyv": np.unique(rows["YUYV"]).tolist(),
    }


def refuses_substitutes():
    return [
        refused(lambda: V4l2Camera(V4l2Request(DEVICE, 700, 500, pixel_format="GREY")), DeviceSettingError),
        refused(lambda: V4l2Camera(request("MJPG")), DeviceSettingError),
        refused(lambda: V4l2Camera(request(frame_rate_hz=999.0)), DeviceSettingError),
    ]


def gain_without_automatic():
    with V4l2Camera(request(gain=77.0)) as camera:
        assert camera.gain == 77.0
        camera.gain = 123.0
        assert camera.gain == 123.0
        automatic = camera.controls.get(abi.CID_AUTOGAIN)
        out = refused(lambda: setattr(camera, "gain", 9999.0), DeviceSettingError)
        unchanged = camera.gain
    with V4l2Camera(request(automatics_off=False)) as camera:
        camera.controls.set(abi.CID_AUTOGAIN, 1)
        camera.controls.descriptions = {d.name: d for d in camera.controls._enumerate()}
        under = refused(lambda: setattr(camera, "gain", 50.0), DeviceSettingError)
    with V4l2Camera(request()) as camera:
        assert camera.controls.get(abi.CID_AUTOGAIN) == 0
    return {"autogain": automatic, "out of range": out, "then": unchanged, "under automatic": under}


def in_use_is_said():
    with V4l2Camera(request()) as camera:
        good(camera.grab)
        return refused(lambda: V4l2Camera(request()), DeviceBusyError)


def fresh_after_idle():
    with V4l2Camera(request()) as camera:
        good(camera.follow)
        time.sleep(2.0)
        called_s = time.monotonic()
        frame = good(camera.grab)
        stale = dict(camera.gate.refused)
    assert frame.timestamp_s - 1 / 25 >= called_s - 0.05
    return {"stale dropped": stale, "age_s": round(called_s - frame.timestamp_s, 3)}


def sees_dropped_buffers():
    with V4l2Camera(request()) as camera:
        control = camera.controls.named("percentage_of_dropped_buffers")
        camera.controls.set(control.identifier, 40)
        kinds: Counter[str] = Counter()
        good, last = 0, None
        for _ in range(40):
            try:
                frame = camera.follow()
            except FrameError as error:
                kinds[str(error.fault)] += error.lost
                last = None
                continue
            assert last is None or frame.sequence == last + 1
            last, good = frame.sequence, good + 1
        camera.controls.set(control.identifier, 0)
    assert kinds["dropped"] + kinds["late"] > 0
    return {"good": good, "refused": dict(kinds)}


def sees_the_error_flag():
    seen = 0
    with V4l2Camera(request()) as camera:
        for _ in range(5):
            good(camera.grab)
            camera.controls.press("inject_v4l2_buf_flag_error")
            for _ in range(6):
                try:
                    camera.follow()
                except FrameError as error:
                    seen += error.fault == "corrupt"
    assert seen == 5, seen
    return {"injected": 5, "refused": seen}


def burst_through_drops():
    with V4l2Camera(request("Y16")) as camera:
        control = camera.controls.named("percentage_of_dropped_buffers")
        camera.controls.set(control.identifier, 20)
        burst = run_capture(camera, CapturePlan(frames=25, settle_frames=0, max_refused=1000))
        camera.controls.set(control.identifier, 0)
    assert burst.outcome is BurstOutcome.COMPLETE
    assert burst.frames == 25
    return {"refused": dict(burst.refused), "rate_hz": burst.camera.frame_rate_hz}


def a_stall_ends_in_our_own_time():
    """All buffers are dropped: the driver runs, and nothing arrives."""
    with V4l2Camera(request()) as camera:
        control = camera.controls.named("percentage_of_dropped_buffers")
        good(camera.grab)
        camera.controls.set(control.identifier, 100)
        time.sleep(0.5)
        began_s = time.monotonic()
        text = ""
        for _ in range(6):
            try:
                camera.follow()
            except DeviceTimeoutError as error:
                text = str(error)
                break
            except FrameError:
                began_s = time.monotonic()
        took_s = time.monotonic() - began_s
        camera.controls.set(control.identifier, 0)
        frame = good(camera.grab)
    assert text
    assert took_s < 2.0, took_s
    return {"took_s": round(took_s, 2), "says": text, "then a good frame": frame.sequence}


def recovers_from_a_fatal_error():
    with V4l2Camera(request()) as camera:
        good(camera.grab)
        camera.controls.press("inject_fatal_streaming_error")
        began_s = time.monotonic()
        text = ""
        for _ in range(8):
            try:
                camera.follow()
            except DeviceError as error:
                text = f"{type(error).__name__}: {error}"
                if isinstance(error, DeviceNotFoundError | DeviceTimeoutError):
                    break
        took_s = time.monotonic() - began_s
        camera.reconnect()
        frame = good(camera.grab)
    return {"noticed_s": round(took_s, 2), "says": text, "then": frame.pixels.shape}


def sequence_wraps():
    with V4l2Camera(request()) as camera:
        control = camera.controls.named("wrap_sequence_number")
        camera.close()
        camera.reconnect()
        camera.controls.set(control.identifier, 1)
        camera.reconnect()
        sequences, lost = [], 0
        while len(sequences) < 140:
            try:
                sequences.append(camera.follow().sequence)
            except FrameError as error:  # a slow machine loses some, but not 2**32
                lost += error.lost
        camera.controls.set(control.identifier, 0)
    assert sequences[0] > 2**31 > sequences[-1]
    assert lost < 1000
    return {"first": sequences[0], "last": sequences[-1], "lost": lost}


def notices_a_disconnect():
    with V4l2Camera(request()) as camera:
        good(camera.grab)
        began_s = time.monotonic()
        timer = threading.Timer(0.3, lambda: camera.controls.press("disconnect"))
        timer.start()
        text = ""
        while time.monotonic() - began_s < 10:
            try:
                camera.follow()
            except DeviceNotFoundError as error:
                text = str(error)
                break
            except DeviceError:
                continue
        took_s = time.monotonic() - began_s - 0.3
    assert text
    assert took_s < 2.0, took_s
    return {"noticed_s": round(took_s, 2), "says": text, "closed": True}


CHECKS = (
    enumerates,
    captures_exact_types,
    grey_is_the_top_byte_of_y16,
    refuses_substitutes,
    gain_without_automatic,
    in_use_is_said,
    fresh_after_idle,
    sees_dropped_buffers,
    sees_the_error_flag,
    burst_through_drops,
    a_stall_ends_in_our_own_time,
    recovers_from_a_fatal_error,
    sequence_wraps,
    notices_a_disconnect,
)


def main():
    failed = 0
    for check in CHECKS:
        began_s = time.monotonic()
        try:
            line = {"check": check.__name__, "passed": True, "found": check()}
        except Exception as error:
            failed += 1
            where = traceback.extract_tb(error.__traceback__)[-1]
            line = {
                "check": check.__name__,
                "passed": False,
                "error": f"{type(error).__name__}: {error}",
                "line": where.lineno,
            }
        line["s"] = round(time.monotonic() - began_s, 1)
        print(json.dumps(line, default=str), flush=True)
    print(json.dumps({"checks": len(CHECKS), "failed": failed}))
    sys.exit(failed > 0)


main()
