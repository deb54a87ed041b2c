"""FE models from elsewhere: exported matrices, programs that assemble them, programs that solve."""

from skthermo.fem.external._callable import CallableModel
from skthermo.fem.external._exported import load_affine
from skthermo.fem.external._probe import probe

__all__ = ["CallableModel", "load_affine", "probe"]
