import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

from core.checkpoint import decode, encode, newest
from core.result import Outcome
from core.setting import SettingError
from core.solve.loop import LoopSettings, LoopState, run
from core.watch import StoppedError, Watch
from tests.core.solve.memory import Memory


def noisy_bowl(unknowns, data, key):
    """A quadratic seen through mini-batch noise."""
    batch = data + 0.1 * jax.random.normal(key, data.shape)
    loss = ((unknowns - batch) ** 2).mean()
    return loss, {"bowl": loss}


TARGET = jnp.linspace(-1.0, 1.0, 7)


def solve(settings, objective=noisy_bowl, start=None, configuration="a", **options):
    return run(
        objective,
        jnp.zeros(7) if start is None else start,
        TARGET,
        optax.adabelief(0.02),
        settings,
        configuration=configuration,
        **options,
    )


def test_the_step_is_traced_once_for_a_whole_run():
    traces = []

    def counted(unknowns, data, key):
        traces.append(1)  # runs only while tracing
        return noisy_bowl(unknowns, data, key)

    found = solve(LoopSettings(steps=300), counted)
    assert len(traces) == 1
    assert found.outcome is Outcome.step_limit
    assert float(jnp.abs(found.best - TARGET).max()) < 0.2
    assert found.memory_bytes > 0


def test_a_resumed_run_is_bitwise_the_uninterrupted_one():
    whole = solve(LoopSettings(steps=60, record_every=10))
    store = Memory()
    with pytest.raises(StoppedError):
        solve(
            LoopSettings(steps=60, checkpoint_every_steps=25),
            watch=Watch(store=store, should_stop=_after(31)),
        )
    resumed = solve(LoopSettings(steps=60, record_every=10), watch=Watch(store=store))
    np.testing.assert_array_equal(whole.last, resumed.last)
    np.testing.assert_array_equal(whole.best, resumed.best)
    assert whole.history[-1]["loss"] == resumed.history[-1]["loss"]


def _after(calls):
    count = iter(range(calls))
    return lambda: next(count, None) is None


def test_a_stop_request_leaves_a_checkpoint_of_that_very_step():
    # Asked for by step, not by call: a slow machine calls `should_stop` while it waits for a step, too.
    store, done = Memory(), []
    watch = Watch(
        lambda row, growing: done.append(row["step"]) if "step" in row else None,
        lambda: len(done) >= 12,
        store,
    )
    with pytest.raises(StoppedError):
        solve(LoopSettings(steps=60, record_every=1), watch=watch)
    assert newest(store).header["step"] == done[-1] == 12


def test_a_torn_checkpoint_gives_way_to_the_one_before():
    store = Memory()
    solve(LoopSettings(steps=20, checkpoint_every_steps=5), watch=Watch(store=store))
    before, last = sorted(name for name in store if name.isdigit())
    store[last] = store[last][:-3]
    assert newest(store).header["step"] == 15
    del store[before]
    with pytest.raises(SettingError, match="sha256"):
        newest(store)


def test_a_checkpoint_of_another_configuration_is_refused():
    store = Memory()
    solve(LoopSettings(steps=10, checkpoint_every_steps=5), watch=Watch(store=store))
    with pytest.raises(SettingError, match="were changed"):
        solve(LoopSettings(steps=10), watch=Watch(store=store), configuration="b")


def test_checkpoints_have_no_pickle_and_say_what_they_are():
    state = LoopState(*[jnp.zeros(2)] * 3, *[jnp.float32(1)] * 2, jnp.int32(3), jnp.int32(1), jnp.array(True))
    header, leaves = decode(encode(state, configuration="a", step=3, seed=0, history=[]))
    assert {"schema", "configuration", "step", "seed", "history_offset", "versions", "sha256"} <= set(header)
    assert leaves.startswith(b"\x93NUMPY")


def test_nan_ends_the_run_and_keeps_the_last_good_state():
    def breaks(unknowns, data, key):
        loss, parts = noisy_bowl(unknowns, data, key)
        return jnp.where(loss < 0.2, jnp.nan, loss), parts

    found = solve(LoopSettings(steps=500), breaks)
    assert found.outcome is Outcome.nonfinite
    assert "learning rate" in found.outcome.value
    assert np.isfinite(found.best).all()
    assert np.isfinite(found.last).all()
    assert float(((found.last - TARGET) ** 2).mean()) < 0.25


def test_a_plateau_and_a_time_limit_end_a_run_by_name():
    assert solve(LoopSettings(steps=5000, patience=50)).outcome is Outcome.plateau
    assert solve(LoopSettings(steps=10**6, time_limit_s=0.05, patience=10**6)).outcome is Outcome.time_limit


def test_too_little_memory_is_refused_before_the_first_step():
    rows = []
    with pytest.raises(SettingError, match="smaller batches"):
        solve(
            LoopSettings(steps=5, memory_limit_bytes=10), watch=Watch(lambda row, growing: rows.append(row))
        )
    assert [row["doing"] for row in rows] == ["compiled"]
    assert rows[0]["memory_bytes"] > 10


SCRIPT = """
import sys
from pathlib import Path
import numpy as np
import time
from app.jobs.checkpoints import FolderStore
from core.watch import Watch
from tests.core.solve.test_loop import LoopSettings, solve

folder = Path(sys.argv[1])
slow = lambda row, growing: time.sleep(0.01 if "step" in row else 0)
settings = LoopSettings(steps=400, record_every=1, checkpoint_every_steps=20)
found = solve(settings, watch=Watch(slow, store=FolderStore(folder)))
np.save(folder / "end.npy", np.stack([found.last, found.best]))
"""


def test_kill_9_in_the_middle_and_again_ends_bitwise_the_same(tmp_path):
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    root = Path(__file__).parents[3]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    with subprocess.Popen(command, env=environment, cwd=root) as process:
        deadline = time.monotonic() + 120
        while not list(tmp_path.glob("0*.checkpoint")) and time.monotonic() < deadline:
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL
    assert not (tmp_path / "end.npy").exists()
    step = decode(sorted(tmp_path.glob("0*.checkpoint"))[-1].read_bytes()).header["step"]
    assert 0 < step < 400

    subprocess.run(command, env=environment, cwd=root, check=True)

    whole = solve(LoopSettings(steps=400, record_every=1))
    np.testing.assert_array_equal(np.load(tmp_path / "end.npy"), np.stack([whole.last, whole.best]))
