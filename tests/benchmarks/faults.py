"""Ten thousand scripted faults across camera, bursts and projectors; prints the counts as one JSON line.

.venv/bin/python -m tests.benchmarks.faults [FAULTS] [SEED]
"""

import json
import sys
import time

from tests.drivers.fault_storm import whole_storm

began_s, began_cpu_s = time.monotonic(), time.process_time()
counts = whole_storm(*(int(argument) for argument in sys.argv[1:3] or ["10000"])).counts()
counts |= {
    "wall_s": round(time.monotonic() - began_s, 1),
    "cpu_s": round(time.process_time() - began_cpu_s, 1),
}
print(json.dumps(counts))
sys.exit(bool(counts["wrong"]) or counts["longest_s"] > 10)
