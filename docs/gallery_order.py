"""Groups of the gallery's pages, their order, and the index that shows them."""

from pathlib import Path

GROUPS = {
    "First steps": {
        "plot_truss_study": "How well simulated years predict alarms in true ones, healthy and damaged",
        "plot_paper_chain": "The paper's networks on the truss: errors of M1 by member, and alarms",
        "plot_your_own_structure": "A tower: records with gaps and faults, an updated model, intervals",
        "plot_accelerations": "Operational modal analysis of a year, then the same method",
    },
    "Detection and studies": {
        "plot_detectors": "Twelve detectors on simulated and on true damage of the truss",
        "plot_detector_tuning": "Lags, windows and covariances chosen by a search on simulated damage",
        "plot_located_damage": "After an alarm: which span of a footbridge, and which elements in it",
        "plot_owner_report": "A study and an identification on one page for readers who are not engineers",
    },
    "In service and fleets": {
        "plot_in_service": "Two years with failed thermometers, slow loss of stiffness and sudden damage",
        "plot_new_baseline": "A retrofit, and a monitor that starts anew from three days of records",
        "plot_fleet": "Four bridges with 30 days of records learn from sixteen others",
    },
    "Models and updating": {
        "plot_model_updating": "What measured modes determine, and parameters with their uncertainty",
        "plot_regressors": "Seven regressors as inverse surrogate and as temperature mapper",
        "plot_grid_search": "Tuning stages and chain with scikit-learn, on contiguous folds",
        "plot_gauss_newton_step": "Changing the estimated parameters before the next stage",
    },
    "Real bridges": {
        "plot_z24_bridge": "Frost moves the frequencies; errors of predictions in later weather",
        "plot_z24_detection": "Twenty-two detectors on the bridge's measured damage",
        "plot_z24_damage": "Where the damage is, and measured beside simulated rates of alarms",
        "plot_kw51_model": "A tied arch: members, supports and modes of the FE model",
        "plot_kw51_updating": "Eleven properties fitted to six measured frequencies",
        "plot_kw51_study": "The paper's study on a campaign with the measured one's statistics",
    },
}
ORDER = [f"{name}.py" for pages in GROUPS.values() for name in pages]


def position(filename: str) -> int:
    """Place of a page in the gallery; pages that are not listed come last."""
    return ORDER.index(filename) if filename in ORDER else len(ORDER)


def write_index(app) -> None:
    """Replace the gallery's index by one with a heading for each group and a line for each page."""
    examples, gallery = Path(app.srcdir).parent / "examples", Path(app.srcdir) / "gallery"
    parts = [(examples / "README.rst").read_text(encoding="utf-8")]
    for heading, pages in GROUPS.items():
        toctree = [f"   {name}" for name in pages]
        parts += [f"{heading}\n{'-' * len(heading)}\n", ".. toctree::\n   :hidden:\n\n" + "\n".join(toctree) + "\n"]
        parts += [".. grid:: 1 2 3 3\n   :gutter: 3\n   :class-container: gallery\n"]
        for name, line in pages.items():
            title = (examples / f"{name}.py").read_text(encoding="utf-8").splitlines()[1]
            image = f"/gallery/images/thumb/sphx_glr_{name}_thumb.png"
            options = {"link": name, "link-type": "doc", "img-top": image, "img-alt": ""}
            parts += [f"   .. grid-item-card:: {title}"]
            parts += [*(f"      :{option}: {value}" for option, value in options.items()), f"\n      {line}\n"]
    (gallery / "index.rst").write_text("\n".join(parts), encoding="utf-8")


def setup(app) -> None:
    """Sphinx calls this: the index is written after the gallery's pages."""
    app.connect("builder-inited", write_index, priority=900)
