"""`python -m app.jobs FOLDER`: the supervisor as a process of its own, as `airlens jobs run` starts it."""

import argparse
import logging
import signal
import sys
import threading
from pathlib import Path

from app.errors import AirlensError
from app.jobs.attended import stop_with_parent
from app.jobs.config import read_config
from app.jobs.ledger import Ledger
from app.jobs.supervisor import Supervisor


def supervise(folder: Path, *, with_parent: bool = False) -> None:
    """Run the queue of a folder until SIGTERM or SIGINT, or its parent ends; running jobs go on."""
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    if with_parent:
        stop_with_parent(stop)
    Supervisor(Ledger(folder), read_config(folder)).run(stop)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="app.jobs", description="Run the queue of jobs in a folder.")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--with-parent", action="store_true", help="end when the parent process ends")
    options = parser.parse_args()
    try:
        supervise(options.folder, with_parent=options.with_parent)
    except AirlensError as error:
        sys.exit(f"airlens: {error}")
