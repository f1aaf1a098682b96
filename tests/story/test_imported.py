"""Pictures of one camera, captured here and brought as files: the same temperature within its deviation."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from app.experiment.capture_files import read_raw_stack
from app.pipeline import reconstruct
from app.simulate.rehearsal import SAMPLE_ROOM
from app.volume.score import score_experiment
from core.result import Solution
from tests.app.setup.test_new import ANSWERS, run

BITS = 12


def solved(folder: Path) -> tuple[Solution, float]:
    """A draft, and how wrong its temperature is."""
    solution = reconstruct(folder, "draft").finding.solution
    return solution, score_experiment(folder, SAMPLE_ROOM)["T"]["rms_K"]


def written(folder: Path, kind: str, frames: list[np.ndarray]) -> str:
    """The frames as files of one kind, as their camera might have written them; a pattern that names them."""
    folder.mkdir()
    for number, counts in enumerate(frames):
        path = folder / f"{number:02}.{kind}"
        if kind == "tif":
            tifffile.imwrite(path, counts)
        else:
            pixels = counts if kind == "png" else (counts >> (BITS - 8)).astype(np.uint8)
            cv2.imwrite(str(path), pixels, [] if kind == "png" else [cv2.IMWRITE_JPEG_QUALITY, 95])
    return str(folder / f"*.{kind}")


@pytest.fixture(scope="module")
def captured(tmp_path_factory) -> tuple[str, dict[str, list[np.ndarray]], Solution, float]:
    """The answers, the frames of both captures, and what is found from them where they were taken."""
    folder = tmp_path_factory.mktemp("captured") / "lab"
    answers = ANSWERS.replace("TRUTH", str(SAMPLE_ROOM)).replace("OUTLET", "297.5")
    run("new", folder, "--from", "-", text=answers)
    frames = {}
    for role in ("reference", "flow"):
        run("capture", role, folder, "--frames", 20, "--raw-stack")
        (stack,) = folder.glob(f"captures/*{role}*/frames.tif")
        frames[role] = read_raw_stack(stack)[0]
    return answers, frames, *solved(folder)


@pytest.mark.parametrize(("kind", "share"), [("tif", 0.1), ("png", 0.1), ("jpg", 1.0)])
def test_what_is_imported_gives_the_temperature_of_the_capture(captured, tmp_path, kind, share):
    answers, frames, own, own_rms_k = captured
    run("new", tmp_path / "lab", "--from", "-", text=answers)
    names = {role: written(tmp_path / role, kind, taken) for role, taken in frames.items()}
    bits = ("--bits", BITS) if kind != "jpg" else ()
    run("import", tmp_path / "lab", "--reference", names["reference"], "--flow", names["flow"], *bits)

    found, rms_k = solved(tmp_path / "lab")

    assert own.temperature_std_k is not None
    apart = np.abs(found.temperature_k - own.temperature_k) / own.temperature_std_k
    print(
        f"{kind}: {apart.max():.3f} deviations apart at most; rms {rms_k:.3f} K, captured {own_rms_k:.3f} K"
    )
    # Files without loss hold the same counts; only the noise is another: measured, not stated.
    assert apart.max() < share
