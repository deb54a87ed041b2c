"""Random samples of parameters, their frequencies and derivatives, and measurement noise."""

from skthermo.fem.sampling._evaluate import evaluate
from skthermo.fem.sampling._evaluate_modes import evaluate_modes
from skthermo.fem.sampling._linearise import linearise
from skthermo.fem.sampling._linearise_modes import linearise_modes
from skthermo.fem.sampling._noise import add_noise
from skthermo.fem.sampling._sample import sample

__all__ = ["add_noise", "evaluate", "evaluate_modes", "linearise", "linearise_modes", "sample"]
