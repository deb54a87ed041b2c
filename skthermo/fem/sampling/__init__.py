"""Random samples of parameters, their frequencies and derivatives, and measurement noise."""

from skthermo.fem.sampling._evaluate import add_noise, evaluate, evaluate_modes, linearise, linearise_modes, sample

__all__ = ["add_noise", "evaluate", "evaluate_modes", "linearise", "linearise_modes", "sample"]
