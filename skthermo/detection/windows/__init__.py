"""Alarms raised by several records in a row."""

from skthermo.detection.windows._windowed_alarm import WindowedAlarm

__all__ = ["WindowedAlarm"]
