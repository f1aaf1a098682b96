"""What is quick to begin stays so: no module loads what it does not need at once. Counts modules, not time."""

import subprocess
import sys

# Each costs between a third of a second and several.
HEAVY = (
    "jax",
    "cv2",
    "scipy",
    "skimage",
    "matplotlib",
    "fastapi",
    "starlette",
    "xarray",
    "equinox",
    "h5netcdf",
)


def loaded_by(code, names):
    """Those of `names` that are loaded once `code` ran in a process of its own."""
    asked = f"import sys\nprint(*[name for name in {names!r} if name in sys.modules])"
    ran = subprocess.run(
        [sys.executable, "-P", "-c", f"{code}\n{asked}"], capture_output=True, text=True, check=True
    )
    return ran.stdout.splitlines()[-1].split()


def test_a_notebook_imports_the_client_without_the_service():
    assert loaded_by("import app.client", HEAVY) == []


def test_what_is_loaded_is_found():
    assert loaded_by("import app.api.factory", HEAVY[:2]) == ["jax", "cv2"]
