"""Patterns for the back wall: wavelet noise, dots, checkerboard; Gray code for calibration."""

from core.pattern.gray import decode_gray as decode_gray
from core.pattern.gray import gray_code as gray_code
from core.pattern.make import make_pattern as make_pattern
from core.pattern.make import pattern_parts as pattern_parts
