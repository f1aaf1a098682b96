"""What JAX tells of compiling reaches us: a program that is made, and one that is found on the disk."""

import jax
import jax.numpy as jnp
import pytest

from app.plan.compiling import Compiled, compiling


@pytest.fixture
def a_cache(tmp_path):
    """A folder for compiled programs, empty."""
    before = jax.config.jax_compilation_cache_dir
    jax.config.update("jax_compilation_cache_dir", str(tmp_path))
    jax.experimental.compilation_cache.compilation_cache.reset_cache()
    yield tmp_path
    jax.config.update("jax_compilation_cache_dir", before)
    jax.experimental.compilation_cache.compilation_cache.reset_cache()


def compiled() -> Compiled:
    """What is compiled for one function in a process that never saw it."""
    jax.clear_caches()
    before = compiling().so_far
    jax.jit(lambda x: jnp.sin(x) * 0.1234567 + jnp.cos(x) ** 3)(jnp.ones(7)).block_until_ready()
    return compiling().so_far.since(before)


def test_a_program_is_made_once_and_then_found(a_cache):
    made, found = compiled(), compiled()
    assert made.programs == found.programs > 0
    assert made.is_warm is False
    assert found.is_warm is True
    assert made.seconds > 0
    assert found.seconds > 0


def test_a_process_listens_once(a_cache):
    assert compiling() is compiling()
    assert Compiled(1.0, 0, 0).is_warm is None
