"""Residuals of healthy records on the weather: their covariance, the range of weather that they know.

It stands on ``_tables``; detectors, chains and monitors stand on it. Start with ``gaussian.py``, then ``cones.py``.
"""

__all__: list[str] = []
