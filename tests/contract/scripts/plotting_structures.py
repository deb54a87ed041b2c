"""A structure in the colours of its groups."""

import matplotlib as mpl

from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
from skthermo.detection import DirectionalDetector
from skthermo.plotting import StructureDisplay

mpl.use("Agg")
errors = {"bottom": 0.2, "top": 0.5, "diagonal": 1.4}
display = StructureDisplay.from_structure(truss_structure(), errors, label="error (%)")
detector = DirectionalDetector(make_truss()).fit(make_truss_campaign(random_state=0).frequencies)
smallest = StructureDisplay.from_estimator(detector, truss_structure())
RESULTS = {
    "label": display.label,
    "limits": display.members_["lines"].get_clim(),
    "members": len(display.members_["lines"].get_segments()),
    "smallest": type(smallest).__name__,
}
mpl.pyplot.close("all")
