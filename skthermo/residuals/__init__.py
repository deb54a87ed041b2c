"""Residuals of healthy records on the weather: their covariance, the range of weather that they know.

It uses ``_tables``; detectors, chains and monitors use it. Start with ``gaussian.py``, then ``cones.py``.
"""

__all__: list[str] = []
