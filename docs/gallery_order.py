"""Order of the gallery's pages: first the method where the truth is known, then real bridges, then its parts."""

ORDER = [
    "plot_truss_study.py",
    "plot_your_own_structure.py",
    "plot_accelerations.py",
    "plot_detectors.py",
    "plot_detector_tuning.py",
    "plot_z24_bridge.py",
    "plot_z24_detection.py",
    "plot_z24_damage.py",
    "plot_kw51_model.py",
    "plot_kw51_updating.py",
    "plot_kw51_study.py",
    "plot_model_updating.py",
    "plot_owner_report.py",
    "plot_located_damage.py",
    "plot_in_service.py",
    "plot_new_baseline.py",
    "plot_fleet.py",
    "plot_gauss_newton_step.py",
    "plot_regressors.py",
    "plot_grid_search.py",
]


def position(filename: str) -> int:
    """Place of a page in the gallery; pages that are not listed come last."""
    return ORDER.index(filename) if filename in ORDER else len(ORDER)
