"""What loggers write: the form of files, their records, and which of their columns are temperatures or responses.

It uses ``_core``. Start with ``together.py``, which reads several files; ``stamps.py`` finds their times.
"""
