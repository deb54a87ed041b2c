"""What all estimators share: warnings that point to the user's line, answers kept for equal questions, work in parts.

It uses scikit-learn and joblib alone. Start with ``warnings.py``.
"""
