"""Examples that chance makes: a part of them is tried each time, all at night."""

import os


def by_day(part, at_night):
    """What is tried each time; all of it where the environment has SKTHERMO_NIGHTLY, as .ci/nightly sets it."""
    return at_night if "SKTHERMO_NIGHTLY" in os.environ else part
