"""How Sphinx builds the pages: `make docs`, warnings are errors."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [
    str(ROOT),
    str(ROOT / "app"),
    str(ROOT / "docs" / "_ext"),
]  # of this checkout, whatever is installed

project = "faceambig"
author = "The faceambig developers"
copyright = author  # noqa: A001 - Sphinx's own name
release = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "docstrings", "formulas"]
exclude_patterns = ["_build", "_ext"]
root_doc = "index"
html_theme = "furo"
html_title = f"{project} {release}"
html_extra_path = ["ambiguity_player.html"]  # a page that stands on its own: copied as it is

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
html_math_renderer = "mathml"  # _ext/formulas.py

autodoc_typehints = "signature"
python_maximum_signature_line_length = 90
nitpicky = True
# Types of other packages, and of ours that are not public: named, with no page to lead to
nitpick_ignore_regex = [("py:.*", r"(?!faceambig\.).*"), ("py:.*", r"faceambig\.\w+\..*")]
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
