"""Errors that an operator can act on. `cli` shows them as one sentence; the API as problem+json."""


class AirlensError(Exception):
    """Something failed: exit status 1. The message says what happened, what was expected, what to do."""


class BadInputError(AirlensError):
    """A file, option or setting that cannot be used: exit status 2."""
