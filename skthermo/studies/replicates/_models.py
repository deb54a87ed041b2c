"""FE models that the training records of a chain leave possible."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from skthermo._estimators.warnings import without_warnings
from skthermo._tables.arrays import as_floats
from skthermo.updating import ModelUpdater

DEVIATION = 0.005  # relative, of measured mean frequencies from those of a perfect model
SPREAD = 0.15  # relative deviation of stiffnesses before anything is measured
HALF_WIDTH = 0.6  # of the box in which stiffnesses are looked for


def drawn_models(fem: Any, number: int, seed: int) -> list[Any]:
    """Models calibrated to the mean of the training records, as far as these determine stiffnesses."""
    mean = np.nanmean(as_floats(fem.training_records_[1]), axis=0)
    with without_warnings():
        try:
            updater = ModelUpdater(fem.model, bounds=HALF_WIDTH, prior=SPREAD).fit(mean, frequency_std=DEVIATION * mean)
            return list(updater.sample_models(number, spread=SPREAD, random_state=seed))
        except (AttributeError, TypeError, ValueError) as error:
            raise ValueError(
                f"other models like {fem.model!r:.200} cannot be drawn from the training records ({error}); expected "
                "models=[...], or uncertainty without 'model', such as ('noise', 'baseline', 'weather')"
            ) from error


def checked_models(fem: Any, models: Any) -> list[Any]:
    """Models that a chain can be refitted with, or an error."""
    if isinstance(models, str) or not isinstance(models, Sequence) or not len(models):
        raise ValueError(
            f"models is {models!r:.200}; expected a list of FE models, as ModelUpdater.sample_models gives"
        )
    wanted = list(fem.model.parameter_names), fem.model.n_modes
    for number, model in enumerate(models):
        found = list(getattr(model, "parameter_names", [])), getattr(model, "n_modes", None)
        if found != wanted:
            raise ValueError(
                f"model {number} of models is {model!r:.200} with parameters {found[0]} and {found[1]} modes; expected "
                f"the chain's {wanted[0]} and {wanted[1]} modes"
            )
    return list(models)
