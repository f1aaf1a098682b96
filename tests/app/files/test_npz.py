"""NumPy's files that several threads read at once."""

import sys
import threading

import numpy as np

from app.files.npz import read_npy, read_npz


def test_threads_that_read_at_once_all_find_a_good_file_good(tmp_path):
    single, several = tmp_path / "one.npy", tmp_path / "two.npz"
    np.save(single, np.arange(3.0))
    np.savez(several, **{name: np.arange(3.0) for name in "abcdefgh"})
    failed: list[Exception] = []

    def read():
        try:
            for _ in range(40):
                assert len(read_npz(several, "Export it again.")) == 8
                assert len(read_npy(single)) == 3
        except Exception as error:  # whatever a thread meets is the test's to tell
            failed.append(error)

    interval_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        threads = [threading.Thread(target=read) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        sys.setswitchinterval(interval_s)
    assert not failed
