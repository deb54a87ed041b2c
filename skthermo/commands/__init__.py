"""What users start from a shell: a monitor from files of loggers to pages.

It stands on all packages, and none on it. Start with ``main.py``, then ``_bridge.py``, which does a command's work.
"""

__all__: list[str] = []
