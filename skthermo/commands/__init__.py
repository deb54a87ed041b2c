"""What users start from a shell: a monitor from files of loggers to pages.

It uses all packages, and none uses it. Start with ``main.py``, then ``_bridge.py``, which does a command's work.
"""

__all__: list[str] = []
