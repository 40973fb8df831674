"""The result of a search over a roadmap as rows and sentences: what each further metre buys, and the other ways."""

from __future__ import annotations

import math
from collections.abc import Mapping

from rich import box
from rich.table import Table

from topobelief.search.result import SearchResult, Way, said


def front_rows(result: SearchResult, count: int = 5, *, names: Mapping[int, str] | None = None) -> list[tuple[str, ...]]:
    """Some ways of the front: length, closures, objective without cost, its bound, and what of the gain of the longest it has.

    The bound is that of all walks which are no longer; where nothing is known of any of them there is no such cell.

    Parameters
    ----------
    result
    count
        How many at most, spread over the lengths, at least 2.
    names
        Of ways by their places on the front; where given, they begin the rows.
    """
    places = result.few_places(count)
    ways = [result.on_front[place] for place in places]
    most = max((result.value_now - _objective(way) for way in ways), default=0.0)
    return [
        (
            *(() if names is None else (names.get(place, ""),)),
            f"{way.length:.1f} m",
            *_sights(result, way),
            said(_objective(way), result.objective),
            *((_bound(result, way),) if len(result.front_bounds) else ()),
            f"{100 * (result.value_now - _objective(way)) / most:.0f} %" if most > 0 else "–",
        )
        for place, way in zip(places, ways, strict=True)
    ]


def front_table(result: SearchResult, count: int = 5, *, names: Mapping[int, str] | None = None) -> Table:
    """Some ways of the front, shortest first; names as for `front_rows`."""
    columns = ("way", *_sights(result), "after it", *(("none below",) if len(result.front_bounds) else ()), "of the gain")
    table = _table("what each further metre buys", columns if names is None else ("", *columns))
    for row in front_rows(result, count, names=names):
        table.add_row(*row)
    return table


def ways_table(result: SearchResult) -> Table:
    """The best way and its alternatives."""
    names = ["way", *_sights(result), "after it"] + (["with its cost"] if result.cost_per_metre else [])
    table = _table("the best ways found", ("#", *names))
    for rank, way in enumerate((result.best, *result.alternatives), start=1):
        cells = [f"{way.length:.1f} m", *_sights(result, way), said(_objective(way), result.objective)]
        cells += [said(way.value, result.objective)] if result.cost_per_metre else []
        table.add_row(str(rank), *cells, style="bold green" if rank == 1 else "")
    return table


def certificate(result: SearchResult) -> list[str]:
    """What is proven, of which walks, and at which expense, in sentences."""
    work = f"{result.num_evaluations} ways evaluated in {result.seconds:.1f} s; stopped: {_REASONS[result.stopped_by]}."
    if math.isinf(result.lower_bound):
        return [work, "Nothing is proven of other ways."]
    bound = said(result.lower_bound, result.objective)
    told = [work, f"No walk has less than {bound}: {result.covers}."]
    if result.own_closures_gain > 0:
        told.append(f"Those among the poses of the best way gain {said(result.own_closures_gain, result.objective)}.")
    return told


_REASONS = {
    "proof": "the best way is proven",
    "gap": "the gap asked for is reached",
    "enough": "nothing more than enough is left to gain",
    "deadline": "the time is up",
    "evaluations": "as many ways were evaluated as allowed",
    "interrupt": "interrupted",
    "rest": "neither value nor bound improved any more",
}


def _sights(result: SearchResult, way: Way | None = None) -> tuple[str, ...]:
    """Loops that are expected to be closed and, where any way sees landmarks, observations; names of columns without a way."""
    ways = (result.best, *result.alternatives, *result.on_front)
    cells = ("closures", "observations")
    if way is not None:
        cells = (f"{way.action.expected_closures:.3g}", f"{way.action.expected_observations:.3g}")
    return cells if any(each.action.num_observations for each in ways) else cells[:1]


def _bound(result: SearchResult, way: Way) -> str:
    bound = result.bound_within(way.length)
    return "–" if math.isinf(bound) else said(bound, result.objective)


def _objective(way: Way) -> float:
    """Without the cost of its length."""
    return way.value - way.action.cost


def _table(title: str, columns: tuple[str, ...]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1), pad_edge=False, title=title, title_justify="left", title_style="bold")
    for name in columns:
        table.add_column(name, justify="right", no_wrap=True)
    return table
