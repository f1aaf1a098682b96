import numpy as np
import pytest

from drivers.burst import CapturePlan
from drivers.capture import run_capture
from drivers.protocols import Frame
from drivers.saturation import saturated_share
from drivers.simulated import SimulatedCamera
from tests.drivers.scenes import pattern


def frame(level, contrast, end, full_scale, step=1, noise=0.01, seed=0):
    """A pattern with noise, digitised in steps, whose counts end at `end`; and the part that is cut off."""
    wall = pattern(240, 320, level=level, contrast=contrast) * end
    counts = wall * (1 + noise * np.random.default_rng(seed).standard_normal(wall.shape))
    cut = np.clip(step * np.rint(counts / step), 0, end)
    kind = np.uint8 if full_scale < 256 else np.uint16
    return Frame(cut.astype(kind), 1, 0.0, full_scale), float(np.mean(counts >= end))


# Full scale; 12 bits at the top of 16; 12 bits at the bottom of 16; video's limited range; a sensor that clips early.
ENDS = [(4095, 4095, 1), (65520, 65535, 16), (4095, 65535, 1), (235, 255, 1), (4000, 4095, 1)]


@pytest.mark.parametrize(("end", "full_scale", "step"), ENDS)
@pytest.mark.parametrize("level", [0.75, 0.9, 1.1, 2.0])
def test_cut_off_pixels_are_counted_wherever_the_counts_end(end, full_scale, step, level):
    seen, cut = frame(level, 0.2, end, full_scale, step)
    # A count that is rounded up to the end is counted with those above it.
    assert saturated_share(seen) == pytest.approx(cut, rel=0.1, abs=0.003)
    assert saturated_share(seen, every=2) == pytest.approx(cut, rel=0.1, abs=0.01)


@pytest.mark.parametrize(("end", "full_scale", "step"), ENDS)
@pytest.mark.parametrize(("level", "contrast"), [(0.3, 0.2), (0.5, 0.1), (0.5, 0.0), (0.05, 0.2)])
def test_a_frame_whose_counts_do_not_end_has_no_saturated_pixel(end, full_scale, step, level, contrast):
    for seed in range(20):
        assert saturated_share(frame(level, contrast, end, full_scale, step, seed=seed)[0]) == 0.0


@pytest.mark.parametrize("value", [0, 1, 100, 4000])
def test_a_frame_of_one_count_tells_nothing_and_dark_counts_are_no_pile_up(value):
    even = np.full((64, 64), value, np.uint16)
    assert saturated_share(Frame(even, 1, 0.0, 4095)) == 0.0
    assert saturated_share(Frame(np.full((64, 64), 4095, np.uint16), 1, 0.0, 4095)) == 1.0
    dark = (np.random.default_rng(0).random((64, 64)) < 0.7).astype(np.uint8) + 16
    assert saturated_share(Frame(dark, 1, 0.0, 255)) == 0.0


def test_a_burst_whose_counts_end_below_full_scale_is_not_fit():
    class Early(SimulatedCamera):
        """Its counts end at 3500 of 4095."""

        def _draw(self, index):
            return np.minimum(super()._draw(index), 3500)

    view = pattern(level=0.75, contrast=0.2)
    burst = run_capture(Early(lambda: view, seed=1), CapturePlan(frames=4))
    found = next(verdict for verdict in burst.verdicts if verdict.name == "saturation")
    assert not found.good
    assert found.value == pytest.approx(float(np.mean(view > 3500 / 4095)), abs=0.03)
