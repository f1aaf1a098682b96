"""Composes drivers, calibration and core: command line, experiments, jobs, service, reports."""

import os

# Before NumPy is imported: its BLAS reads it once. Fits are many small products, often several at a time; threads of
# BLAS then wait for one another (a fit on a busy machine: 172 CPU s with two, 142 with one).
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
