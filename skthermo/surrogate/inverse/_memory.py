"""Stored simulations, shared by processes."""

from pathlib import Path
from pickle import PicklingError
from typing import Any

import joblib
from joblib import Memory
from sklearn.utils import Bunch
from sklearn.utils.validation import check_memory

from skthermo._io import lock
from skthermo.fem import sample, share_reordered

ORDER_CHECKS = 256  # number of samples whose modes are looked at for another order


def remembered_simulations(memory: str | Memory | None, model: Any, *settings: Any) -> tuple[Bunch, float, Any]:
    """`simulations`, read from the memory if stored there; of several processes only one makes them."""
    try:
        memory = check_memory(memory)
    except OSError as error:
        raise ValueError(f"memory is {memory!r}; expected a folder that can be written to ({error})") from error
    if memory.location is None:
        return simulations("", model, *settings)
    try:
        identity = joblib.hash(model, coerce_mmap=True)
    except PicklingError as error:
        raise ValueError(
            f"memory cannot recognise {model!r}; expected one that can be pickled, with functions and classes from a "
            "module that can be imported (no lambda, nothing from a script, a notebook or a function), or memory=None"
        ) from error
    folder = Path(memory.location)
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / f"{identity}.lock", "w") as file:
        lock(file)
        return memory.cache(simulations, ignore=["model", "n_jobs"])(identity, model, *settings)


def simulations(
    identity: str, model: Any, bounds: Any, n_samples: int, tol: float | None, dofs: Any, n_jobs: Any, seed: int
) -> tuple[Bunch, float, Any]:
    """Random samples, the share with modes in another order, and the reduced model if ``tol`` is given, else None."""
    reduced = None if tol is None else model.reduced(bounds, tol=tol, random_state=seed)
    model = reduced or model
    drawn = sample(model, bounds, n_samples, dofs=dofs, n_jobs=n_jobs, random_state=seed)
    sorts = not getattr(model, "track", True) and hasattr(model, "modes")
    return drawn, share_reordered(model, drawn.theta[:ORDER_CHECKS]) if sorts else 0.0, reduced
