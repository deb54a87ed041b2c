"""Detectors in service: records that come in batches, sensors that fail, structures that age."""

__all__: list[str] = []
