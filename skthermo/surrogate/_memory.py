"""Simulations that are remembered."""

from pathlib import Path
from pickle import PicklingError
from typing import Any

import joblib
from joblib import Memory
from numpy.typing import ArrayLike
from sklearn.utils import Bunch
from sklearn.utils.validation import check_memory

from skthermo._locks import lock
from skthermo.fem import FEModel, sample


def remembered_sample(
    memory: str | Memory | None, model: FEModel, bounds: ArrayLike, n_samples: int, *, n_jobs: int | None, seed: int
) -> Bunch:
    """`sample`, looked up in a memory; processes that want the same simulations wait for the first.

    Raises
    ------
    ValueError
        If the model cannot be recognised when it comes again.
    """
    memory = check_memory(memory)
    if memory.location is None:
        return sample(model, bounds, n_samples, n_jobs=n_jobs, random_state=seed)
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
        return memory.cache(_sample, ignore=["model", "n_jobs"])(identity, model, bounds, n_samples, n_jobs, seed)


def _sample(identity: str, model: FEModel, bounds: Any, n_samples: int, n_jobs: int | None, seed: int) -> Bunch:
    return sample(model, bounds, n_samples, n_jobs=n_jobs, random_state=seed)
