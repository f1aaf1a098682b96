"""The science: refractive rays, rendering, Boussinesq residuals, reconstruction, uncertainty.

Arrays in, arrays out: no hardware, no files, no web. SI units; `refractivity` is eta - 1.
"""

import os
import sys

# Recent GPUs multiply float32 matrices in TF32 unless told otherwise: 1e-3 errors where 1e-6 is needed.
# JAX reads the variable when it is imported: what needs only a setting's type does not wait for it.
os.environ["JAX_DEFAULT_MATMUL_PRECISION"] = "highest"
if "jax" in sys.modules:
    sys.modules["jax"].config.update("jax_default_matmul_precision", "highest")
