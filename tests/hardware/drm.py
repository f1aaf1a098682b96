"""Show random greys through the kernel's display driver and hold them; see README. Prints the digest."""

import json
import sys
import time
from pathlib import Path

import numpy as np

from drivers.drm import DrmDisplay
from drivers.errors import DeviceSettingError

with DrmDisplay(Path(sys.argv[1])) as display:
    rows, cols = display.size
    picture = np.random.default_rng(0).integers(0, 256, (rows, cols), dtype=np.uint8)
    digest = display.show(picture)
    try:
        display.show(picture[1:])
        refused = ""
    except DeviceSettingError as error:
        refused = str(error)
    line = {
        "rows": rows,
        "cols": cols,
        "digest": digest,
        "showing": display.is_showing(digest),
        "refused": refused,
    }
    print(json.dumps(line), flush=True)
    time.sleep(float(sys.argv[2]))
