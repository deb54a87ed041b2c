"""What all rooms stand on: tables and their times, text, warnings, parallel work, files, scikit-learn's helpers.

It uses no room. Start with ``estimators.py``, the only file that imports private functions of scikit-learn, and
``frames.py``, records with their times.
"""
