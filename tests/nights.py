"""Examples that chance makes: a part of them is tried each time, all at night."""

from hypothesis import settings

NIGHTLY = settings.default.max_examples > 100  # by the profile that conftest.py registers


def by_day(part, at_night):
    """What is tried each time; all of it with ``--hypothesis-profile=nightly``."""
    return at_night if NIGHTLY else part
