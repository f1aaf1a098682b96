"""Bursts at the camera's rate: frames lost, memory, CPU seconds, and the error of mean and deviation.

.venv/bin/python -m tests.benchmarks.burst [COLSxROWS] [FRAMES] [BITS] [RATE_HZ]
"""

import json
import resource
import sys
import time

import cv2
import numpy as np

from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.clock import SystemClock
from drivers.simulated import SensorNoise, SimulatedCamera

size, frames, bits, rate_hz = (sys.argv[1:5] + ["1920x1080", "64", "16", "15"][len(sys.argv) - 1 :])[:4]
cols, rows = (int(part) for part in size.split("x"))
noise = np.random.default_rng(0).standard_normal((rows, cols), dtype=np.float32)
view = 0.5 + 0.1 * cv2.GaussianBlur(noise, (0, 0), 1.5) / np.float32(0.19)
del noise
view = np.clip(view, 0, 1).astype(np.float32)
sensor = SensorNoise(bits=int(bits))
camera = SimulatedCamera(
    lambda: view, seed=1, noise=sensor, frame_rate_hz=float(rate_hz), exposure_s=0.5 / float(rate_hz),
    clock=SystemClock(),
)  # fmt: skip
camera.grab()  # the expected counts are prepared once a view
cpu_s, wall_s = time.process_time(), time.monotonic()
burst = run_capture(camera, CapturePlan(frames=int(frames), settle_frames=0))
cpu_s, wall_s = time.process_time() - cpu_s, time.monotonic() - wall_s
scale = (sensor.full_scale_counts - sensor.dark_counts) / sensor.full_scale_counts
true_mean = sensor.dark_counts / sensor.full_scale_counts + scale * view
true_std = scale * np.sqrt(view / sensor.full_well_e + (sensor.read_noise_e / sensor.full_well_e) ** 2)
within = view < 0.95  # clipping at full scale bends both
line = {
    "size": size,
    "frames": burst.frames,
    "bits": int(bits),
    "rate_hz": float(rate_hz),
    "reached_hz": round(burst.frames / wall_s, 2),
    "refused": dict(burst.refused),
    "cpu_s": round(cpu_s, 2),
    "wall_s": round(wall_s, 2),
    "rss_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3),
    "mean_error_in_standard_errors": float(
        np.std((burst.mean - true_mean)[within] / true_std[within] * burst.frames**0.5).round(4)
    ),
    "std_ratio": float(np.sqrt(np.mean(burst.std[within] ** 2) / np.mean(true_std[within] ** 2)).round(4)),
    "outcome": burst.outcome,
}
print(json.dumps(line))
