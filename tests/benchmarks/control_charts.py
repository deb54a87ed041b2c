"""A control chart beside which windows are measured, and correlated residuals to try them on."""

import numpy as np
from scipy.signal import lfilter
from sklearn.covariance import EmpiricalCovariance

BURN_IN = 200


def cusum(records, allowance):
    """Length of Crosier's multivariate cumulative sum, which shrinks by the allowance with every record."""
    total, lengths = np.zeros(records.shape[1:]), np.empty(records.shape[:-1])
    for i, record in enumerate(records):
        total = total + record
        length = np.linalg.norm(total, axis=-1)
        total *= np.maximum(1 - allowance / length, 0.0)[..., np.newaxis]
        lengths[i] = np.maximum(length - allowance, 0.0)
    return lengths


def whitened(baseline, records):
    """Records in standard deviations of a baseline, uncorrelated there."""
    law = EmpiricalCovariance().fit(baseline)
    return (records - law.location_) @ np.linalg.cholesky(law.precision_)


def correlated(random, shape, correlation):
    """Normal numbers of unit variance whose correlation along the first axis falls off as in an AR(1) process."""
    steps = random.standard_normal((shape[0] + BURN_IN, *shape[1:]))
    return lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], steps, axis=0)[BURN_IN:]
