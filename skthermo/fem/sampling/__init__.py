"""Random samples of parameters, their frequencies and derivatives, and measurement noise."""

from skthermo.fem.sampling._evaluate import evaluate, evaluate_modes
from skthermo.fem.sampling._linearise import linearise, linearise_modes
from skthermo.fem.sampling._noise import add_noise
from skthermo.fem.sampling._sample import sample

__all__ = ["add_noise", "evaluate", "evaluate_modes", "linearise", "linearise_modes", "sample"]
