"""Breaks files of a service's data folder by hand and asks for everything; one JSON line at the end.

    python -m tests.benchmarks.broken_files --files 5000

Each file is broken in one way (cut, emptied, random, nested deep, long numbers, another type, a folder or a loop
of links in its place), every list and every resource that reads it is asked for, and it is put back. Counted
are answers of 500, and lists that lack a sound item.
"""

import argparse
import json
import random
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import httpx
import numpy as np
import xarray as xr

from app.experiment.folder import write_manifest
from tests.benchmarks.served import unlimited
from tests.benchmarks.two_hands import bodge_capture

Break = Callable[[Path, random.Random], None]


def _cut(path: Path, dice: random.Random) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: dice.randrange(len(content) + 1)])


def _flip(path: Path, dice: random.Random) -> None:
    content = bytearray(path.read_bytes() or b"x")
    for _ in range(dice.choice((1, 10, 100))):
        content[dice.randrange(len(content))] = dice.randrange(256)
    path.write_bytes(content)


def _random(path: Path, dice: random.Random) -> None:
    path.write_bytes(dice.randbytes(dice.choice((0, 1, 100, 5000))))


def _deep(path: Path, dice: random.Random) -> None:
    opening = dice.choice((b"[", b'{"a":', b"a = [", b"[[", b'{"views": [', b"a.b" * 3))
    path.write_bytes(opening * dice.choice((10, 2000, 50_000)))


def _long(path: Path, dice: random.Random) -> None:
    digits = b"9" * dice.choice((40, 5000, 100_000))
    path.write_bytes(dice.choice((b'{"views": %s}', b"schema_version = %s", b"%s", b'{"step": %s}')) % digits)


def _other(path: Path, dice: random.Random) -> None:
    words = (
        b"null",
        b"1",
        b'"a"',
        b"[]",
        b"{}",
        b'{"views": [{}]}',
        b'{"role": null}',
        b"NaN",
        b'"\\ud800"',
        b"a = nan",
    )
    path.write_bytes(dice.choice(words))


def _value(path: Path, dice: random.Random) -> None:
    """Another value behind a key of a text file."""
    lines = path.read_bytes().splitlines(keepends=True) or [b""]
    at = dice.randrange(len(lines))
    key, mark, _ = lines[at].partition(dice.choice((b":", b"=")))
    value = dice.choice(
        (b"-1", b"1e400", b"1" + b"0" * 40, b'""', b"[]", b"{}", b"true", b"inf", b"'a'", b'"\\u0000"')
    )
    lines[at] = key + mark + value + dice.choice((b"\n", b",\n"))
    path.write_bytes(b"".join(lines))


def _folder(path: Path, dice: random.Random) -> None:
    path.unlink()
    path.mkdir()


def _loop(path: Path, dice: random.Random) -> None:
    path.unlink()
    path.symlink_to(path.name)


WAYS: tuple[Break, ...] = (
    _cut,
    _cut,
    _flip,
    _flip,
    _random,
    _deep,
    _long,
    _other,
    _value,
    _value,
    _value,
    _folder,
    _loop,
)


def fill(http: httpx.Client, root: Path) -> tuple[str, str, Path]:
    """Make two experiments with a capture, a result, a plan, an upload; return the first's and second's name."""
    names = []
    for _ in range(2):
        made = http.post(
            "/api/experiments", json={"kind": "simulated", "camera_px": 64, "world": "ideal"}
        ).json()["experiment"]
        folder = root / "experiments" / made
        names.append(made)
        bodge_capture(folder)
        (folder / "captures" / "c1" / "notes.txt").write_text("dry")
        http.post(f"/api/experiments/{made}/calibration", json={"kind": "simulated"}).raise_for_status()
        result = folder / "results" / "r1"
        result.mkdir(parents=True)
        _result(result / "result.nc")
        (result / "history.jsonl").write_text('{"step": 1, "loss": 0.5}\n' * 3)
        write_manifest(result, {"preset": "draft", "outcome": "CONVERGED", "created": "2026-01-01"})
        (folder / "plan.json").write_text("{}")
    content = b"\x93NUMPY\x01\x00v\x00{'descr': '|u1', 'fortran_order': False, 'shape': (4,), }"
    content += b" " * (10 + 118 - len(content) - 1) + b"\n" + bytes(4)
    sent = http.post("/api/uploads", content=content, headers={"Content-Type": "application/octet-stream"})
    sent.raise_for_status()
    return names[0], names[1], root / "uploads" / sent.json()["upload"]


def _result(path: Path) -> None:
    axes = {axis: np.linspace(0.0, 1.0, 3) for axis in "xyz"}
    values = {name: ("xyz", np.full((3, 3, 3), 300.0, np.float32)) for name in ("T", "p", "u", "v", "w")}
    values = {name: (tuple(dims), array) for name, (dims, array) in values.items()}
    notes = {"outcome": "CONVERGED", "solver_s": 1.0, "notes": ""}
    xr.Dataset(values, axes, notes).to_netcdf(path, engine="h5netcdf")


def broken(http: httpx.Client, root: Path, files: int, seed: int = 0) -> Counter[str]:
    """Break `files` files, one after the other; return what was answered."""
    name, other, upload = fill(http, root)
    folder = root / "experiments" / name
    targets = [path for path in folder.rglob("*") if path.is_file() and not path.name.startswith(".")]
    targets += [upload / "manifest.json", root / "service" / "confirmed.json"]
    (root / "service" / "confirmed.json").write_text("{}")
    dice, counts = random.Random(seed), Counter[str]()
    for number in range(files):
        path, way = targets[number % len(targets)], dice.choice(WAYS)
        kept = path.with_name(".kept")
        shutil.copy2(path, kept)
        way(path, dice)
        counts["broken"] += 1
        counts += asked(http, name, other, f"{path.name} by {way.__name__}")
        shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        kept.replace(path)
    return counts


def asked(http: httpx.Client, name: str, other: str, what: str) -> Counter[str]:
    """Ask for everything that reads the broken experiment's files."""
    counts = Counter[str]()
    here = f"/api/experiments/{name}"
    items = ("", "/calibration", "/calibration/guide", "/plan", "/captures/c1", "/captures/c1/picture")
    items += (
        "/results/r1",
        "/results/r1/slices/T",
        "/results/r1/history",
        "/results/r1/comparison",
        "/addresses",
    )
    for path in [here + item for item in items] + ["/api/uploads", "/api/jobs", "/api/events/list"]:
        answer = http.get(path)
        counts[f"{answer.status_code // 100}xx"] += 1
        if answer.status_code >= 500:
            print(what, path, answer.text[:300], flush=True)
    for path, sound in (("/api/experiments", other), (f"/api/experiments/{other}/captures", "c1")):
        lines = http.get(path)
        if lines.status_code != 200 or not any(sound in line.values() for line in lines.json()):
            print(what, path, lines.text[:300], flush=True)
            counts["lists that failed"] += 1
    for kind in ("captures", "results"):
        counts["lists that failed"] += http.get(f"{here}/{kind}").status_code not in (200, 404, 422)
    return counts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    root = Path(tempfile.mkdtemp())
    try:
        with (
            unlimited(root) as service,
            httpx.Client(base_url=service.url, headers=service.headers, timeout=100, trust_env=False) as http,
        ):
            started_s = time.perf_counter()
            counts = broken(http, root, options.files, options.seed)
            wall_s = round(time.perf_counter() - started_s, 1)
        print(json.dumps({"benchmark": "broken_files", "wall_s": wall_s, **counts}))
    finally:
        shutil.rmtree(root, ignore_errors=True)


if __name__ == "__main__":
    main()
