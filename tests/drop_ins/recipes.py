"""The recipes of the user guide, as they stand in its pages or in files beside them."""

import re
import textwrap
from pathlib import Path

GUIDE = Path(__file__).parents[2] / "docs" / "guide"


def run_recipe(page, *names, **defined):
    """What recipes of a page define, run one after the other with some names given."""
    for name in names:
        exec(compile(code_of(page, name), name, "exec"), defined)
    return defined


def code_of(page, name):
    text = (GUIDE / page).read_text()
    file = name.removeprefix("recipe-").replace("-", "_") + ".py"
    if f"literalinclude:: recipes/{file}\n" in text:
        return (GUIDE / "recipes" / file).read_text()
    block = re.search(rf"code-block:: py\n    :name: {name}\n\n((?:    .*\n|\n)+)", text)
    return textwrap.dedent(block[1])
