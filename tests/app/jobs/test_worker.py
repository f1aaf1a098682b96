"""A worker hears of a stop whatever its main thread does."""

import signal
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[3]
# One call of a library's, which looks at no signal until it returns, as a compilation does.
BUSY = """
import hashlib, threading, time
from app.worker import hear
stop = threading.Event()
hear(stop)
threading.Thread(target=lambda: (time.sleep(1), print("begun", flush=True)), daemon=True).start()
threading.Thread(target=lambda: (stop.wait(), print("heard", flush=True)), daemon=True).start()
hashlib.pbkdf2_hmac("sha256", b"", b"", 40_000_000)
print("returned", flush=True)
"""


def test_a_stop_is_heard_in_the_middle_of_one_long_call():
    command = [sys.executable, "-c", BUSY]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        process.send_signal(signal.SIGTERM)
        assert process.stdout.readline() == "heard\n"
        process.kill()
