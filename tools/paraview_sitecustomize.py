"""Lets ParaView 5.11.0 load plugins in Python 3.11; Python imports this when it starts.

ParaView's ``paraview/detail/pythonalgorithm.py`` imports ``inspect.getargspec``, which Python 3.11
has removed. It asks for the names of a function's arguments only, which ``getfullargspec`` gives
under the same name. ``install_paraview.sh`` copies this file as ``sitecustomize.py`` into the
environment, and only for a ParaView that needs it.
"""

import importlib.machinery
import importlib.util
import inspect
import sys
from pathlib import Path

if not hasattr(inspect, "getargspec"):
    inspect.getargspec = inspect.getfullargspec

# The system may have a sitecustomize of its own, which this one hides
_elsewhere = [folder for folder in sys.path if Path(folder) != Path(__file__).parent]
_hidden = importlib.machinery.PathFinder.find_spec("sitecustomize", _elsewhere)
if _hidden is not None and _hidden.loader is not None:
    _hidden.loader.exec_module(importlib.util.module_from_spec(_hidden))
