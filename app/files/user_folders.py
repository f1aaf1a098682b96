"""Where a user's own files lie: what may be made again in the cache, what must not be lost in the state."""

from pathlib import Path

import platformdirs


def cache_folder() -> Path:
    """What can be made again: compiled programs, this machine's speeds."""
    return platformdirs.user_cache_path("airlens", appauthor=False)


def state_folder() -> Path:
    """What a later run must know: when a lamp was lit."""
    return platformdirs.user_state_path("airlens", appauthor=False)
