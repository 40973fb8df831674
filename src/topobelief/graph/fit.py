"""Whether a graph stands near the maximum-likelihood estimate, away from which entropies and bounds do not describe the map.

chi^2 per degree of freedom is near 1 at the estimate if the information matrices are calibrated. At 100 the root mean square of
the residuals is ten standard deviations: an estimate fits so badly only where noise is claimed ten times too small or closures
are false. Of nine public files, seven that hold dead reckoning have 119 to 20 000 as filed and at most 1 once optimised. One
whose noise is claimed far too large has 11 as filed: no warning is given for such graphs, because optimised ones may have as
much.
"""

from __future__ import annotations

import warnings

from topobelief.errors import NotOptimizedWarning
from topobelief.graph.pose_graph import PoseGraph

LARGEST_CHI2_PER_DOF = 100.0


def misfit(graph: PoseGraph, *, optimized: bool = False) -> str | None:
    """A sentence on a graph that fits its measurements badly; None for one that does not, and for a tree, which always fits.

    Parameters
    ----------
    graph
    optimized
        Whether it is known to be at its estimate, so that its measurements or their noise must be wrong.
    """
    if graph.degrees_of_freedom <= 0 or graph.chi2 <= LARGEST_CHI2_PER_DOF * graph.degrees_of_freedom:
        return None
    size = f"χ² per degree of freedom is about {graph.chi2 / graph.degrees_of_freedom:.0e}"
    if optimized:
        return (
            f"{size} at the estimate, so measurements contradict each other far beyond their noise and entropies and bounds "
            "mean little; look for false loop closures, or for noise that is claimed too small"
        )
    return (
        f"{size}, so these poses are far from the maximum-likelihood estimate and entropies and bounds taken at them mean "
        "little; optimise the graph first"
    )


def warn_of_misfit(graph: PoseGraph) -> None:
    """Warn the caller's caller of a graph that is far from its estimate; Python shows it once for each place."""
    if message := misfit(graph):
        warnings.warn(f"{message} (topobelief.optimize)", NotOptimizedWarning, stacklevel=3)
