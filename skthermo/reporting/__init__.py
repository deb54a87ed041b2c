"""Pages for the owners of structures."""

from skthermo.reporting._owner_report import owner_report

__all__ = ["owner_report"]
