"""Topological belief space planning: where should a robot drive next, when its map is a pose graph?

`import topobelief as tb` loads nothing heavy; each public name, listed in the stub beside this file, loads its room when it is
first used.
"""

import importlib

__getattr__, __dir__, __all__ = importlib.import_module("lazy_loader").attach_stub(__name__, __file__)
