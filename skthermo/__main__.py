"""``python -m skthermo``."""

import sys

from skthermo.commands.main import main

if __name__ == "__main__":
    sys.exit(main())
