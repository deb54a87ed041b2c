"""Scripts are run by ``test_scripts.py``; pytest need not look for examples in them."""

collect_ignore = ["scripts"]
