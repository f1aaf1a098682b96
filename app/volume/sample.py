"""The packaged room, solved from first principles, that a rehearsal and a simulated camera look at."""

from pathlib import Path

SAMPLE_ROOM = Path(__file__).resolve().parents[1] / "simulate" / "sample" / "room.npz"
