"""Draws the figures of ``docs/quickstart.rst`` by the code that the page shows.

python tools/quickstart_figures.py
"""

import doctest
import re
from pathlib import Path

import matplotlib.pyplot as plt

DOCS = Path(__file__).parents[1] / "docs"


def main() -> None:
    """Run the page's examples, and save each display as the figure that follows it."""
    text = (DOCS / "quickstart.rst").read_text()
    images, names = iter(re.findall(r"figure:: /(\S+)", text)), {}
    for example in doctest.DocTestParser().get_examples(text):
        exec(example.source, names)
        if example.source.startswith("display = "):
            names["display"].figure_.savefig(DOCS / next(images), dpi=130, bbox_inches="tight")
    with plt.rc_context({"font.size": 7}):  # for narrow screens, one panel below the other
        figure, axes = plt.subplots(3, figsize=(3.6, 5.4), layout="constrained")
        names["display"].plot(axes)
        axes[0].get_legend().remove()
        handles = {label: mark for ax in axes for mark, label in zip(*ax.get_legend_handles_labels(), strict=True)}
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2)
        figure.savefig(DOCS / "images" / "quickstart_study_narrow.png", dpi=200)


if __name__ == "__main__":
    main()
