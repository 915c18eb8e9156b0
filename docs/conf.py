"""Settings of Sphinx. Build the site in the root of the repository, after `pip install '.[docs]'`:

    sphinx-build -W --keep-going -c docs . build/docs

The root is the folder of the sources, so that one relative link works on the site and where the files lie.
"""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "ringsweep"
author = "The ringsweep developers"
copyright = f"{author}, BSD-3-Clause"  # noqa: A001 - the name that Sphinx reads
release = version_of("ringsweep")

extensions = [
    "extension",
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx-mathjax-offline",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
root_doc = "docs/index"
include_patterns = [
    "docs/**",
    "notebooks/*.ipynb",
    "benchmarks/results/*.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "CODE_OF_CONDUCT.md",
]
# What matches is never entered: environments, caches and builds hold thousands of files.
exclude_patterns = [".*", "**/.*", "build", "dist", "docs/gallery", "docs/gallery_pages/*.ipynb"]

nb_execution_mode = "off"
nb_merge_streams = True
myst_enable_extensions = ["dollarmath", "smartquotes"]
myst_heading_anchors = 3
nitpicky = True
nitpick_ignore_regex = [("py:class", ".*")]  # types in docstrings are words of English
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False

sphinx_gallery_conf = {
    "examples_dirs": "docs/gallery",
    "gallery_dirs": "docs/gallery_pages",
    "filename_pattern": r"\.py",
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "image_scrapers": ("extension.collect_figures",),
    "capture_repr": (),
    "abort_on_example_error": True,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1e6,
}

# All pages stand in one table of contents, which is always in view. Nothing is loaded from elsewhere.
html_theme = "furo"
html_title = f"ringsweep {release}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_extra_path = ["root/index.html"]
html_copy_source = False
html_show_sphinx = False
