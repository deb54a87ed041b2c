"""Residuals of healthy records on the weather: their covariance, the range of weather that they know.

It uses ``preprocessing``; detectors, chains and monitors use it. Start with ``gaussian.py``, then ``baseline.py``.
"""

__all__: list[str] = []
