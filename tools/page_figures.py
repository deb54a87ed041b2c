"""Draws figures of pages: some in two widths, for screens and for telephones; the page of a monitor as a picture.

python tools/page_figures.py quickstart
python tools/page_figures.py pod_curves
python tools/page_figures.py status_page
"""

import doctest
import re
import subprocess
import sys
import tempfile
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


def status_page() -> None:
    """The page that README's commands write, and the records of the damaged bridge, with Chromium."""
    text = (ROOT / "README.md").read_text()
    code = re.findall(r"^skthermo (.*?)(?:#.*)?$|`skthermo (update .*?)`", text, flags=re.MULTILINE)
    with tempfile.TemporaryDirectory() as folder:
        for block, sentence in code:
            subprocess.run([sys.executable, "-m", "skthermo", *(block or sentence).split()], cwd=folder)
        picture = f"--screenshot={IMAGES / 'status_page.png'}"
        browser = ["chromium", "--headless", "--no-sandbox", "--hide-scrollbars", "--window-size=900,820"]
        subprocess.run([*browser, picture, "river/status.html"], cwd=folder, check=True)


if __name__ == "__main__":
    name = sys.argv.pop(1)
    {"quickstart": quickstart, "pod_curves": pod_curves, "status_page": status_page}[name]()
