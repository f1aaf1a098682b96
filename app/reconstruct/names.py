"""The names of the presets, known without what they solve with."""

from app.errors import BadInputError

# What every door takes where nobody chooses.
AUTO = "auto"
NAMES = (AUTO, "draft", "standard", "reference", "grid", "paper")


def known(name: str) -> str:
    """The name, if a preset has it. Raises BadInputError."""
    if name not in NAMES:
        raise BadInputError(f"There is no preset {name!r}; known: {', '.join(NAMES)}.")
    return name
