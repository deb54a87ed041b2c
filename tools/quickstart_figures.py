"""Draws the figures of ``docs/quickstart.rst`` by the code that the page shows.

python tools/quickstart_figures.py
"""

import doctest
import re
from pathlib import Path

DOCS = Path(__file__).parents[1] / "docs"


def main() -> None:
    """Run the page's examples, and save each display as the figure that follows it."""
    text = (DOCS / "quickstart.rst").read_text()
    images, names = iter(re.findall(r"figure:: /(\S+)", text)), {}
    for example in doctest.DocTestParser().get_examples(text):
        exec(example.source, names)
        if example.source.startswith("display = "):
            names["display"].figure_.savefig(DOCS / next(images), dpi=130, bbox_inches="tight")


if __name__ == "__main__":
    main()
