"""Tables and their times, text, warnings, parallel work, files, and the helpers of scikit-learn, for all rooms.

It uses no room. Start with ``estimators.py``, the only file that imports private functions of scikit-learn, and
``frames.py``, records with their times.
"""
