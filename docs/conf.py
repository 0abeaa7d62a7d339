"""Sphinx configuration; the build treats warnings as errors."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

from docutils import nodes
from numpydoc.xref import DEFAULT_LINKS
from sphinx.application import Sphinx

import pyvista_vdi
from pyvista_vdi import __version__

sys.path.insert(0, str(Path(__file__).parent))  # where live.py is

project = "pyvista-vdi"
author = "The pyvista-vdi developers"
copyright = f"2026, {author}"
version = release = __version__

extensions = [
    "live",
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
    "sphinx_gallery.gen_gallery",
]
# The pictures are committed (docs/make_gallery.py): a build of the site executes nothing. Pages and
# lists of who uses what come from the scripts' text
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "backreferences_dir": "auto_gallery/backreferences",
    "doc_module": ("pyvista_vdi",),
    "plot_gallery": False,
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "remove_config_comments": True,
    "download_all_examples": False,
    "show_signature": False,
    "thumbnail_size": (320, 240),
}
# Links into others' pages need their inventories from the network, which a build that must pass
# does without. VTK has none of its classes: those pages are Doxygen's, with addresses of one form
if os.environ.get("PYVISTA_VDI_INTERSPHINX") == "1":
    extensions.append("sphinx.ext.intersphinx")
intersphinx_mapping = {
    "numpy": ("https://numpy.org/doc/stable/", None),
    "python": ("https://docs.python.org/3/", None),
    "pyvista": ("https://docs.pyvista.org/", None),
}
VTK_CLASS = "https://vtk.org/doc/nightly/html/class{}.html"
copybutton_exclude = ".linenos, .gp, .go"
templates_path = ["_templates"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}  # .rst: autosummary's own pages
exclude_patterns = ["_build", "gallery", "readme.md"]

myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 3

autosummary_generate = True
autodoc_typehints = "none"  # numpydoc's Parameters sections say them, with shapes and units
numpydoc_show_class_members = False  # autodoc lists the members
numpydoc_class_members_toctree = False
# Types of parameters lead to their pages: those of this package, and by the above of others
numpydoc_xref_param_type, numpydoc_xref_ignore = True, "all"
PYVISTA = "Camera ImageData Light LookupTable MultiBlock Plotter VolumeProperty"
VTK = "Camera ImageData Light Renderer VolumeMapper VolumeProperty"
OTHERS = ["numpy.ndarray", *(f"pyvista.{name}" for name in PYVISTA.split())]
OTHERS += [f"vtk{name}" for name in VTK.split()]
numpydoc_xref_aliases = {
    **{name: name for name in DEFAULT_LINKS},  # "float", "sequence" are left as they are
    **{name: f":class:`{name}`" for name in OTHERS},
    **{name: f":class:`~pyvista_vdi.{name}`" for name in pyvista_vdi.__all__ if name[0].isupper()},
}
autodoc_default_options = {"members": True}

html_theme = "furo"
html_title = f"pyvista-vdi {version}"
html_static_path = ["_static"]


def link_vtk(_app: object, _env: object, node: nodes.Element, text: nodes.Element) -> object:
    """Return a link to VTK's page of a class, for a reference that leads nowhere else."""
    name = str(node.get("reftarget", "")).rpartition(".")[2]
    if not re.fullmatch(r"vtk[A-Z]\w+", name):
        return None
    return nodes.reference("", "", text, internal=False, refuri=VTK_CLASS.format(name))


def setup(app: Sphinx) -> None:
    """Connect what makes those links."""
    app.connect("missing-reference", link_vtk)
