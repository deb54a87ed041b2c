"""Draws figures that pages show in two widths: beside each other for screens, below each other for telephones.

python tools/page_figures.py quickstart
python tools/page_figures.py pod_curves
"""

import doctest
import re
import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"


def quickstart() -> None:
    """The displays of ``docs/quickstart.rst``, by the code that the page shows."""
    text = (ROOT / "docs" / "quickstart.rst").read_text()
    images = iter(name for name in re.findall(r"figure:: /images/(\S+)", text) if "narrow" not in name)
    names: dict[str, Any] = {}
    for example in doctest.DocTestParser().get_examples(text):
        exec(example.source, names)
        if match := re.match(r"(display|drawn) = ", example.source):
            names[match[1]].figure_.savefig(IMAGES / next(images), dpi=130, bbox_inches="tight")
    with plt.rc_context({"font.size": 7}):
        figure, axes = plt.subplots(3, figsize=(3.6, 5.4), layout="constrained")
        names["display"].plot(axes)
        axes[0].get_legend().remove()
        handles = {label: mark for ax in axes for mark, label in zip(*ax.get_legend_handles_labels(), strict=True)}
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2)
        figure.savefig(IMAGES / "quickstart_study_narrow.png", dpi=200)


def pod_curves() -> None:
    """The curves of ``examples/plot_truss_study.py``, whose later sections take longer and are left out."""
    sys.path.append(str(ROOT / "examples"))
    code = (ROOT / "examples" / "plot_truss_study.py").read_text().partition("# Which detector?")[0]
    names: dict[str, Any] = {}
    exec(code, names)
    draw_curves = names["draw_curves"]
    figure, axes = plt.subplots(1, 3, figsize=(11, 4), layout="constrained", sharey=True)
    draw_curves(axes, n_columns=4)
    figure.savefig(IMAGES / "pod_curves.png", dpi=130)
    with plt.rc_context({"font.size": 7}):
        figure, axes = plt.subplots(3, figsize=(3.6, 6), layout="constrained", sharex=True)
        draw_curves(axes, n_columns=2)
        figure.savefig(IMAGES / "pod_curves_narrow.png", dpi=200)


if __name__ == "__main__":
    name = sys.argv.pop(1)
    {"quickstart": quickstart, "pod_curves": pod_curves}[name]()
