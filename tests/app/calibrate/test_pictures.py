"""Pictures that a calibration keeps."""

import subprocess
import sys


def test_a_picture_that_a_full_disk_cuts_off_says_so_and_leaves_nothing(tmp_path):
    # A process that may write 1 kB a file: what a full disk looks like to a writer.
    code = (
        "import resource, signal, sys; from pathlib import Path; import numpy as np\n"
        "from app.calibrate.pictures import save\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "save(Path(sys.argv[1]), np.random.default_rng(0).integers(0, 255, (64, 64)).astype(np.uint8))"
    )
    path = tmp_path / "view_00.png"
    ran = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False)
    assert ran.returncode != 0
    assert "File too large" in ran.stderr
    assert not list(tmp_path.iterdir())
