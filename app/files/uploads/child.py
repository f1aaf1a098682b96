"""The limited child that reads an upload.

    python -I -m app.files.uploads.child KIND FILE FOLDER MEMORY SECONDS BYTES

It writes one NPY an array into FOLDER and prints what it found as JSON. It may use so much memory, so many
seconds of processor, and write so much; a decoder's fault ends here and nowhere else.
"""

import json
import resource
import sys
from pathlib import Path


def limit(memory_bytes: int, cpu_s: int, file_bytes: int) -> None:
    """Bound this process before any decoder is loaded."""
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))
    resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64))


def main(arguments: list[str]) -> int:
    """Read one file; exit status 0 and JSON on standard output, or 1 and a reason."""
    kind, source, folder, memory_bytes, cpu_s, file_bytes = arguments
    limit(int(memory_bytes), int(cpu_s), int(file_bytes))
    # Only now: what decodes foreign bytes is loaded under the limits.
    from app.files.uploads.decode import decode

    try:
        found = decode(kind, Path(source), Path(folder))
    except (ValueError, OSError, MemoryError, RuntimeError, KeyError, IndexError, TypeError) as error:
        sys.stdout.write(json.dumps({"reason": f"{type(error).__name__}: {str(error)[:200]}"}))
        return 1
    sys.stdout.write(json.dumps({"arrays": found}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
