"""Pages of the gallery, run as scripts, and the modules beside them."""

import runpy
import sys
from importlib import import_module
from pathlib import Path

import pytest

pytest.importorskip("matplotlib").use("Agg")
from matplotlib import pyplot  # noqa: E402

EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path.append(str(EXAMPLES))  # which Python does itself for a file that it runs


def run(name, *arguments):
    """The names that a page defines where it is run with these arguments; figures are closed."""
    page, before = EXAMPLES / f"plot_{name}.py", sys.argv
    sys.argv = [str(page), *map(str, arguments)]
    pyplot.close("all")  # those of other tests are not the page's
    try:
        return runpy.run_path(str(page), run_name="__main__")
    finally:
        sys.argv = before
        pyplot.close("all")


def recipes(name):
    """The module with the functions of some pages."""
    return import_module(f"{name}_recipes")
