"""What a fitted mapper learns from."""

from typing import Any

from sklearn.pipeline import Pipeline


def mapper_inputs(mapper: Any, T: Any) -> Any:
    """Inputs of the last step of a fitted mapper, such as lagged temperatures."""
    mapper = getattr(mapper, "best_estimator_", mapper)
    return mapper[:-1].transform(T) if isinstance(mapper, Pipeline) and len(mapper) > 1 else T


def last_step(mapper: Any) -> Any:
    """The step of a fitted mapper that learns from the inputs that `mapper_inputs` gives."""
    mapper = getattr(mapper, "best_estimator_", mapper)
    return mapper[-1] if isinstance(mapper, Pipeline) else mapper
