"""Sphinx: the documentation of fxcrack. Nothing is fetched while it is built."""

import fxcrack  # before petsc4py

project = "fxcrack"
author = "the fxcrack developers"
release = version = fxcrack.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"fxcrack {version}"
html_baseurl = ""
html_show_sphinx = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "show-inheritance": False}
napoleon_use_ivar = True
napoleon_use_rtype = False
python_use_unqualified_type_names = True
nitpicky = False
exclude_patterns = ["_build"]
