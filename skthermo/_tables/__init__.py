"""Arguments and records as arrays and frames: read, matched by name, given back, saved and put into text.

It uses NumPy and pandas alone. Start with ``arrays.py`` for arguments, ``frames.py`` for records and their times.
"""
