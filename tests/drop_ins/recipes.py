"""The recipes of the user guide, as they stand there."""

import re
import textwrap
from pathlib import Path

GUIDE = Path(__file__).parents[2] / "docs" / "guide"


def run_recipe(page, *names, **defined):
    """What recipes of a page define, run one after the other with some names given."""
    for name in names:
        block = re.search(rf"code-block:: py\n    :name: {name}\n\n((?:    .*\n|\n)+)", (GUIDE / page).read_text())
        exec(compile(textwrap.dedent(block[1]), name, "exec"), defined)
    return defined
