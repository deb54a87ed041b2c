"""Sphinx configuration."""

import skthermo

project = "skthermo"
author = "The skthermo developers"
copyright = "2026, The skthermo developers"
version = release = skthermo.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "numpydoc",
]
autosummary_generate = True
autodoc_typehints = "none"
numpydoc_show_class_members = False
templates_path = ["_templates"]

html_theme = "furo"
html_title = f"skthermo {release}"
exclude_patterns = ["_build"]
