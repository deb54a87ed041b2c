"""What users start from a shell, on top of all packages."""

__all__: list[str] = []
