"""Which further measurement would make smaller damage detectable."""

from skthermo.studies.extension._compare_extensions import compare_extensions

__all__ = ["compare_extensions"]
