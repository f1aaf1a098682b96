"""Parallel writers over every route that writes an experiment's files; one JSON line at the end.

    python -m tests.benchmarks.two_hands --rounds 10000 --hands 3

A round is one change by every hand at once: title, notes or board of one experiment, the notes of a capture,
the calibration, a new experiment; some with `If-Match`. Counted are answers of 5xx, files that cannot be read
afterwards, and acknowledged changes that are neither there nor replaced by a later acknowledged one.
"""

import argparse
import json
import random
import shutil
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx

from app.experiment.capture_files import BurstImage, write_image
from app.experiment.folder import open_experiment, read_manifest, write_manifest
from app.files.provenance import sha256
from tests.benchmarks.served import unlimited

MOST_MADE = 20


@dataclass
class Told:
    """What was acknowledged: for every field, the values with the moments of request and answer."""

    values: dict[str, list[tuple[float, float, Any]]] = field(default_factory=dict)
    lock: threading.Lock = field(default_factory=threading.Lock)

    def add(self, name: str, asked_s: float, answered_s: float, value: Any) -> None:
        """Note one acknowledged value."""
        with self.lock:
            self.values.setdefault(name, []).append((asked_s, answered_s, value))

    def lost(self, name: str, there: Any) -> bool:
        """Whether what is there is not one of the values that may be the last."""
        told = self.values.get(name, [])
        if not told:
            return False
        # A value may be last unless another one was asked for only after it was answered.
        latest_asked_s = max(asked_s for asked_s, _, _ in told)
        return there not in [value for _, answered_s, value in told if answered_s >= latest_asked_s]


class Hand:
    """One writer: sends changes of a kind chosen at random and notes what was acknowledged."""

    def __init__(self, url: str, token: str, experiment: str, capture: str, told: Told, seed: int) -> None:
        self.http = httpx.Client(
            base_url=url + "/api", headers={"Authorization": f"Bearer {token}"}, timeout=100, trust_env=False
        )
        self.counts: Counter[str] = Counter()
        self._path, self._capture = f"/experiments/{experiment}", capture
        self._told, self._random, self._seed, self._number = told, random.Random(seed), seed, 0

    def act(self) -> None:
        """Send one change."""
        self._number += 1
        word = f"hand {self._seed} change {self._number}"
        act: Callable[[str], None] = self._random.choices(
            [self._title, self._notes, self._board, self._capture_notes, self._calibrate, self._make],
            [30, 25, 10, 25, 9, 1],
        )[0]
        act(word)

    def _title(self, word: str) -> None:
        self._change({"title": word})

    def _notes(self, word: str) -> None:
        self._change({"information": word + " ö" * self._random.randrange(200)})

    def _board(self, word: str) -> None:
        columns = 3 + self._number % 190
        self._change({"board": {"kind": "chessboard", "columns": columns, "rows": 6, "square_m": 0.1}})

    def _change(self, body: dict[str, Any]) -> None:
        headers = {}
        if self._random.random() < 0.3:
            headers["If-Match"] = f'"{self.http.get(self._path).json()["revision"]}"'
        self._send("PATCH", self._path, body, headers)

    def _capture_notes(self, word: str) -> None:
        self._send("PATCH", f"{self._path}/captures/{self._capture}", {"notes": word}, {})

    def _calibrate(self, _word: str) -> None:
        self._send("POST", f"{self._path}/calibration", {"kind": "simulated"}, {})

    def _make(self, word: str) -> None:
        if self.counts["made"] >= MOST_MADE:
            return
        self._send("POST", "/experiments", {"kind": "simulated", "title": word, "camera_px": 64}, {})
        self.counts["made"] += 1

    def _send(self, method: str, path: str, body: dict[str, Any], headers: dict[str, str]) -> None:
        asked_s = time.monotonic()
        answer = self.http.request(method, path, json=body, headers=headers)
        answered_s = time.monotonic()
        self.counts[f"{answer.status_code}"] += 1
        if answer.status_code == 412:
            problem = answer.json()
            self.counts["412 without both versions"] += not (problem["current"] and problem["sent"])
        if method == "PATCH" and answer.status_code == 200:
            for name, value in body.items():
                self._told.add(name, asked_s, answered_s, value)


def bodge_capture(folder: Path) -> str:
    """Put a small capture into an experiment and return its id."""
    import numpy as np

    image = np.full((8, 8), 0.5, np.float32)
    path = folder / "captures" / "c1" / "reference.tif"
    write_image(path, BurstImage(image, image, 1))
    view = {
        "file": path.name,
        "sha256": sha256(path),
        "frames": 1,
        "camera": {},
        "verdicts": [],
        "settings": [],
    }
    write_manifest(folder / "captures" / "c1", {"role": "reference", "complete": True, "views": [view]})
    return "c1"


def rounds(url: str, token: str, root: Path, number: int, hands: int) -> Counter[str]:
    """Let `hands` writers do `number` rounds; return counts of answers, broken files and lost changes."""
    told = Told()
    with httpx.Client(base_url=url, headers={"Authorization": f"Bearer {token}"}, timeout=100) as http:
        made = http.post("/api/experiments", json={"kind": "simulated", "camera_px": 64, "world": "ideal"})
        made.raise_for_status()
    experiment = made.json()["experiment"]
    folder = root / "experiments" / experiment
    capture = bodge_capture(folder)
    writers = [Hand(url, token, experiment, capture, told, seed) for seed in range(hands)]
    barrier = threading.Barrier(hands)

    def run(hand: Hand) -> None:
        for _ in range(number):
            barrier.wait()
            hand.act()

    threads = [threading.Thread(target=run, args=(hand,)) for hand in writers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for hand in writers:
        hand.http.close()
    counts = sum((hand.counts for hand in writers), Counter({"rounds": number}))
    return counts + judged(folder, told)


def judged(folder: Path, told: Told) -> Counter[str]:
    """What is wrong on the disk: unreadable and left-over files, lost changes."""
    settings = open_experiment(folder).settings
    read_manifest(folder / "captures" / "c1")
    board = settings.rig.board
    there = {
        "title": settings.title,
        "information": settings.information,
        "board": {n: getattr(board, n) for n in ("kind", "columns", "rows", "square_m")},
        "notes": (folder / "captures" / "c1" / "notes.txt").read_text(encoding="utf-8"),
    }
    found = Counter({"acknowledged": sum(map(len, told.values.values()))})
    found["lost"] = sum(told.lost(name, value) for name, value in there.items())
    for path in folder.parent.iterdir():
        found["corrupt"] += _broken(path)
        found["left over"] += sum(".tmp" in p.name for p in path.rglob(".*")) + path.name.startswith(".")
    return found


def _broken(folder: Path) -> bool:
    from app.calibrate.folder import CalibrationFolder

    try:
        open_experiment(folder)
        CalibrationFolder(folder).bundle()
    except Exception:
        return True
    return False


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=1000)
    parser.add_argument("--hands", type=int, default=3)
    options = parser.parse_args()
    root = Path(tempfile.mkdtemp())
    try:
        with unlimited(root) as service:
            started_s = time.perf_counter()
            counts = rounds(service.url, service.token, root, options.rounds, options.hands)
            wall_s = round(time.perf_counter() - started_s, 1)
        print(json.dumps({"benchmark": "two_hands", "hands": options.hands, "wall_s": wall_s, **counts}))
    finally:
        shutil.rmtree(root, ignore_errors=True)


if __name__ == "__main__":
    main()
