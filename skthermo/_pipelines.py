"""Estimators inside pipelines and searches."""

from typing import Any

from sklearn.pipeline import Pipeline

from skthermo._validation import BaseSearchCV


def last_step(estimator: Any) -> Any:
    """The estimator at the end of a pipeline, the best one of a fitted search, or the estimator itself."""
    if isinstance(estimator, Pipeline):
        return last_step(estimator.steps[-1][1])
    if isinstance(estimator, BaseSearchCV):
        return last_step(getattr(estimator, "best_estimator_", estimator.estimator))
    return estimator
