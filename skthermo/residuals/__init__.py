"""Residuals of healthy records on the weather: their covariance, the range of weather that they know."""

__all__: list[str] = []
