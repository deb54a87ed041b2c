"""Sphinx configuration."""

import skthermo

project = "skthermo"
author = "The skthermo developers"
copyright = "2026, The skthermo developers"
version = release = skthermo.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "sphinx.ext.mathjax",
    "numpydoc",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
default_role = "py:obj"
exclude_patterns = ["_build", "gallery/**/*.ipynb"]
templates_path = ["_templates"]

autosummary_generate = True
autodoc_typehints = "none"
toc_object_entries_show_parents = "hide"
numpydoc_show_class_members = False

nitpicky = True
nitpick_ignore_regex = [(r"py:.*", r"(joblib|matplotlib|numpy|pandas|scipy|sklearn)\..*")]

copybutton_prompt_text = ">>> |\\.\\.\\. |\\$ "
copybutton_prompt_is_regexp = True

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": "/plot_",
    "ignore_pattern": r"/(__init__|\w+_recipes)\.py",
    "abort_on_example_error": True,
    "write_computation_times": False,
}

html_theme = "pydata_sphinx_theme"
html_title = f"skthermo {release}"
html_static_path = ["_static"]
html_css_files = ["api.css"]
html_theme_options = {
    "show_nav_level": 1,
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
