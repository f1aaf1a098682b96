"""The kinds of boards by name, apart from what finds them in pictures: a client reads this without OpenCV."""

from typing import Literal

BoardKind = Literal["chessboard", "charuco", "circles", "asymmetric-circles"]
