"""The program ``skthermo``, also ``python -m skthermo``."""

import gc
import sys

MANY = 100_000  # new objects after which Python looks for unreachable ones; most of a short job's are imported for good


def main() -> int:
    """Run the command that the arguments of the program name; its exit code."""
    gc.set_threshold(MANY)
    from skthermo.commands.main import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
