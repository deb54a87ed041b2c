"""Sphinx configuration."""

import sys
from pathlib import Path

import skthermo

sys.path.append(str(Path(__file__).parent))  # for gallery_order

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
    "gallery_order",
]
default_role = "py:obj"
exclude_patterns = ["_build", "gallery/**/*.ipynb", "measured"]
templates_path = ["_templates"]

autosummary_generate = True
autodoc_typehints = "none"
toc_object_entries_show_parents = "hide"
numpydoc_show_class_members = False

# Inventories that come with the docs, so that no build needs a network (tools/write_inventories.py).
intersphinx_mapping = {
    "numpy": ("https://numpy.org/doc/stable/", "_inventories/numpy.inv"),
    "scipy": ("https://docs.scipy.org/doc/scipy/", "_inventories/scipy.inv"),
    "pandas": ("https://pandas.pydata.org/docs/", "_inventories/pandas.inv"),
    "sklearn": ("https://scikit-learn.org/stable/", "_inventories/sklearn.inv"),
}

nitpicky = True
nitpick_ignore_regex = [(r"py:.*", r"(joblib|matplotlib|numpy|pandas|scipy|sklearn)\..*")]

copybutton_prompt_text = ">>> |\\.\\.\\. |\\$ "
copybutton_prompt_is_regexp = True

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "gallery",
    "filename_pattern": "/plot_(?!z24)",  # whose data may not be shipped
    "ignore_pattern": r"(__init__|_recipes)\.py$",
    "copyfile_regex": r"\w+_recipes\.py",  # beside the pages that import them
    "within_subsection_order": "gallery_order.position",
    "download_all_examples": False,
    "capture_repr": (),
    "remove_config_comments": True,
    "image_srcset": ["2x"],
    "parallel": 2,
    "abort_on_example_error": True,
    "write_computation_times": False,
    "backreferences_dir": "gallery/backreferences",
    "doc_module": ("skthermo",),
}

html_theme = "pydata_sphinx_theme"
html_title = f"skthermo {release}"
html_context = {"default_mode": "auto"}
html_static_path = ["_static"]
html_css_files = ["site.css", "api.css"]
html_js_files = [("mathjax/settings.js", {"priority": 100}), "access.js"]
mathjax_path = "mathjax/tex-svg.js"
html_show_sourcelink = False
html_sidebars = {"quickstart": [], "comparison": []}  # which have no pages below them
html_theme_options = {
    "show_nav_level": 1,
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
