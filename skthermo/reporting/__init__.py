"""Pages for the owners of structures.

It uses studies, monitors and fleets, whose facts it puts into words. Start with ``_owner_report.py``.
"""

from skthermo.reporting._owner_report import owner_report

__all__ = ["owner_report"]
