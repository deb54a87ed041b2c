"""Temperature effects in finite-element models, learned from monitoring data alone."""

__version__ = "0.3.0"
