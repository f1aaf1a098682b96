"""The science: refractive rays, rendering, Boussinesq residuals, reconstruction, uncertainty.

Arrays in, arrays out: no hardware, no files, no web. SI units; `refractivity` is eta - 1.
"""

import jax

# Recent GPUs multiply float32 matrices in TF32 unless told otherwise: 1e-3 errors where 1e-6 is needed.
jax.config.update("jax_default_matmul_precision", "highest")
