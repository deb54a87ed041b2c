"""The fitted chain that a study or an identification asks."""

from typing import Any

import numpy as np
import pandas as pd

from skthermo._arrays import Array, as_floats
from skthermo._validation import check_is_fitted
from skthermo._warnings import warn_user


def check_chain(fem: Any) -> None:
    """Raise an error for what is no fitted chain.

    Raises
    ------
    ValueError
        If it is something else, such as an FE model.
    NotFittedError
        If it is not fitted.
    """
    if not hasattr(fem, "simulate"):
        raise ValueError(f"fem is {fem!r:.200}; expected a fitted DataInformedFEM")
    check_is_fitted(fem)


def named_as_in_fit(fem: Any, T: Any) -> Any:
    """Temperatures with column names where the chain was fitted with names, without where it was not.

    One warning says what was assumed; otherwise every part of the chain would give one each time that it is asked.
    """
    names, columns = getattr(fem, "feature_names_in_", None), list(getattr(T, "columns", ()))
    is_named = any(isinstance(name, str) for name in columns)
    if is_named == (names is not None) or np.shape(T)[1:] != (fem.n_features_in_,):
        return T
    if names is None:
        warn_user(
            f"the temperatures have the feature names {columns}, but the chain was fitted without feature names; the "
            "columns are taken in the order that they have",
            "names of temperatures",
        )
        return T.set_axis(range(len(columns)), axis=1)
    warn_user(
        f"the temperatures have no valid feature names; their columns are taken for {list(names)}, as in fit",
        "names of temperatures",
    )
    return T.set_axis(names, axis=1) if columns else pd.DataFrame(as_floats(T), columns=names)


def healthy_frequencies(fem: Any, theta: Array, *, warn: bool = False) -> Array:
    """Frequencies of the undamaged structure in the measured domain, in Hz, (n_rows, n_modes)."""
    return as_floats(fem.aligner_.inverse_transform(fem.simulator_.frequencies(theta, fem.n_jobs, warn=warn)))
