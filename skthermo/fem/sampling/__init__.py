"""Random samples of parameters, their frequencies and derivatives, and measurement noise."""

from skthermo.fem.sampling._evaluate import evaluate
from skthermo.fem.sampling._linearise import linearise
from skthermo.fem.sampling._noise import add_noise, check_noise
from skthermo.fem.sampling._sample import sample

__all__ = ["add_noise", "check_noise", "evaluate", "linearise", "sample"]
