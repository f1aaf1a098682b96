"""Compiled programs on disk: an entry that is not whole costs a compilation and says nothing."""

import os
import subprocess
import sys

_PROGRAM = """
from app.files.compilation_cache import compiled_folder, use_compilation_cache
use_compilation_cache()
import jax
print(jax.jit(lambda x: 2 * x)(21), compiled_folder())
"""


def _run(home) -> str:
    environment = {name: value for name, value in os.environ.items() if name != "JAX_COMPILATION_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _PROGRAM],
        env={**environment, "XDG_CACHE_HOME": str(home)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    return done.stdout


def test_an_entry_that_was_cut_off_is_compiled_again_without_a_word(tmp_path):
    assert _run(tmp_path).startswith("42 ")
    entries = list(tmp_path.rglob("*-cache"))
    assert entries
    for entry in entries:
        entry.write_bytes(entry.read_bytes()[:20])
    assert _run(tmp_path).startswith("42 ")
