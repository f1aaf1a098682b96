"""Errors that an operator can act on. `cli` shows them as one sentence; the API as problem+json."""


class AirlensError(Exception):
    """Something failed: exit status 1. The message says what happened, what was expected, what to do."""


class BadInputError(AirlensError):
    """A file, option or setting that cannot be used: exit status 2."""


def foreseen(error: BaseException) -> bool:
    """Whether an error is one of ours, which says itself what a person should read."""
    from calibration.errors import CalibrationError
    from core.setting import SettingError
    from drivers.errors import DeviceError

    return isinstance(error, AirlensError | SettingError | CalibrationError | DeviceError)


def explained(error: BaseException) -> str:
    """What a person should read of an error: a foreseen one says it itself, any other is named with its kind."""
    if foreseen(error):
        return str(error)
    if isinstance(error, OSError) and error.strerror:
        return f"{error.strerror}: {error.filename or 'no file named'}."
    return f"{type(error).__name__}: {error}."
