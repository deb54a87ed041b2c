"""Following the modes of a structure through the poles that operational modal analysis finds."""

from skthermo.preprocessing.tracking._mode_tracker import ModeTracker

__all__ = ["ModeTracker"]
