"""What can go wrong in a calibration: the message says what was seen, what was expected, what to retake.

CalibrationError
 ├─ TooFewViewsError    fewer views of a board than a model needs: none is at fault, more are wanted
 ├─ BundleError    a bundle that cannot be read or lacks a part
 └─ ImageError     images that cannot be used: unreadable, mixed sizes, out of order, missing
"""


class CalibrationError(ValueError):
    """A calibration that cannot be made from what was given."""


class TooFewViewsError(CalibrationError):
    """Fewer usable views of a board than a model needs."""


class BundleError(CalibrationError):
    """A bundle that cannot be read, or that lacks the part asked for."""


class ImageError(CalibrationError):
    """Images that cannot be used for a calibration."""
