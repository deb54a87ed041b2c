"""One BLAS thread for each worker of the tests, which share the machine's cores; figures without a screen."""

import os

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

os.environ.setdefault("MPLBACKEND", "Agg")
