"""Many bridges: fitted side by side, learning together."""

__all__: list[str] = []
