"""The user's script is run by a test, and not when tests are collected."""

collect_ignore = ["user_script.py"]
