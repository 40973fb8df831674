"""The page of a reproduction, read as text and in a real browser."""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from browsers import browser_test, chromium
from reproductions import smallest_reproduction
from topobelief.report.canvas import save_figure
from topobelief.report.reproduction.figures import NamedFigure, figures_of
from topobelief.report.reproduction.page import page
from topobelief.reproduction.planning_sessions import cases

LONELIEST_POINT = """(() => {
    const map = document.getElementById('map'), paths = map.data.filter((t) => t.meta !== undefined), shown = map.data.at(-1);
    let best = { apart: -1 };
    for (const path of paths) path.x.forEach((x, i) => {
        const others = paths.filter((t) => t !== path).concat([shown]);
        const apart = Math.min(...others.flatMap((t) => t.x.map((u, j) => Math.hypot(u - x, t.y[j] - path.y[i]))));
        if (apart > best.apart) best = { apart, x, y: path.y[i], index: path.meta };
    });
    map.scrollIntoView({ block: 'center' });
    const box = map.getBoundingClientRect(), { xaxis, yaxis } = map._fullLayout;
    return [box.left + xaxis._offset + xaxis.d2p(best.x), box.top + yaxis._offset + yaxis.d2p(best.y), best.index];
})()"""


def written(folder: Path, **changes: Any) -> Path:
    """A page with one figure."""
    pytest.importorskip("plotly")
    found = dataclasses.replace(smallest_reproduction())  # a copy
    for name, value in changes.items():
        object.__setattr__(found, name, value)
    figures = [figure for figure in figures_of(found) if figure.name == "anytime"]
    save_figure(figures[0].draw(), folder / "anytime.png")
    path = folder / "report.html"
    path.write_text(page(found, figures, {"anytime": (folder / "anytime.png").read_bytes()}, ["claims"]), encoding="utf-8")
    return path


def test_the_page_needs_no_network(tmp_path: Path) -> None:
    text = written(tmp_path).read_text(encoding="utf-8")
    own = re.sub(r"<script>.*?</script>", "", text, flags=re.DOTALL)  # plotly names servers that it does not ask
    assert not re.search(r"(src|href)=[\"'](https?:)?//", own)
    assert "@import" not in own


def test_what_comes_from_data_is_escaped(tmp_path: Path) -> None:
    hostile = "</script><img src=x onerror=alert(1)>"
    claims = [dataclasses.replace(claim, measured=hostile, topic='"><b>') for claim in smallest_reproduction().claims]
    text = written(tmp_path, claims=claims, machine={"processor": hostile}).read_text(encoding="utf-8")
    assert hostile not in text
    assert "&lt;img src=x" in text
    assert 'data-topic="&quot;&gt;&lt;b&gt;"' in text


def test_the_data_of_the_page_are_those_of_the_rows(tmp_path: Path) -> None:
    text = written(tmp_path).read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', text, flags=re.DOTALL)
    assert found is not None
    data = json.loads(found[1])
    for session in data["sessions"]:
        rows = cases(smallest_reproduction().actions)[session["name"], session["xi"], 0]
        assert [action["joint"] for action in session["actions"]] == [row.joint for row in rows]
        assert len(session["paths"]) == len(rows)


def test_every_figure_can_be_drawn_as_png_and_pdf(tmp_path: Path) -> None:
    figures: list[NamedFigure] = figures_of(smallest_reproduction())
    assert len({figure.name for figure in figures}) == len(figures) == 12  # without real graphs
    for figure in figures:
        drawn = figure.draw()
        for suffix in ("png", "pdf"):
            save_figure(drawn, tmp_path / f"{figure.name}.{suffix}")
            assert (tmp_path / f"{figure.name}.{suffix}").stat().st_size > 5000


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as started:
        yield started


@pytest.fixture(params=[(1280, 900), (390, 844)], ids=["desktop", "phone"])
def opened(request: pytest.FixtureRequest, browser: Any, tmp_path: Path) -> Iterator[Any]:
    """The page, and afterwards: nothing was complained of and nothing was asked of a network."""
    width, height = request.param
    context = browser.new_context(viewport={"width": width, "height": height}, has_touch=width < 500)
    shown, complaints, asked = context.new_page(), [], []
    shown.on("console", lambda message: complaints.append(message.text))
    shown.on("pageerror", lambda error: complaints.append(str(error)))
    shown.on("request", lambda sent: None if sent.url.startswith(("file:", "data:", "blob:")) else asked.append(sent.url))
    shown.goto(written(tmp_path).as_uri())
    shown.wait_for_selector("#map .main-svg")
    yield shown
    assert complaints == []
    assert asked == []
    context.close()


@browser_test
def test_hovering_an_action_shows_its_path_and_numbers_everywhere(opened: Any) -> None:
    opened.select_option("#session", "S1")
    rows = cases(smallest_reproduction().actions)["S1", 0.35, 0]
    best = min(rows, key=lambda row: row.joint)
    assert opened.inner_text("#selected").startswith(f"Path {best.action} of {len(rows)}")
    other = max(rows, key=lambda row: row.joint)  # the last in the order of the plot
    dot = opened.locator("#bounds .scatterlayer .trace .points path").nth(len(rows) - 1)
    dot.scroll_into_view_if_needed()
    box = dot.bounding_box()
    opened.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    opened.wait_for_function(
        "text => document.getElementById('selected').textContent.startsWith(text)", arg=f"Path {other.action} "
    )
    said = opened.inner_text("#selected").replace("\N{MINUS SIGN}", "-")
    assert f"Joint entropy {other.joint:.2f} nats" in said
    assert f"{other.num_new_poses} new poses, {other.num_closures} closures" in said
    ends = opened.evaluate(
        "(() => { const t = document.getElementById('map').data.at(-1); return [t.x.at(0), t.x.at(-1)]; })()"
    )
    assert ends == [20.0, 26.0]  # the path from start to goal lies on the map
    assert opened.inner_text("#actions tr.on td:first-child") == f"path {other.action}"


@browser_test
def test_hovering_a_path_on_the_map_selects_it(opened: Any) -> None:
    opened.select_option("#session", "S1")
    x, y, index = opened.evaluate(LONELIEST_POINT)
    opened.mouse.move(x, y)
    opened.wait_for_function("text => document.getElementById('selected').textContent.startsWith(text)", arg=f"Path {index} ")


@browser_test
def test_filters_of_the_decision_do_what_they_say(opened: Any) -> None:
    opened.select_option("#session", "S2")
    opened.select_option("#xi", "0.85")
    rows = cases(smallest_reproduction().actions)["S2", 0.85, 0]
    assert opened.locator("#actions tbody tr").count() == len(rows)
    opened.evaluate("(r => { r.value = 15; r.dispatchEvent(new Event('input')); })(document.getElementById('longest'))")
    assert opened.locator("#actions tbody tr").count() == sum(row.length <= 15 for row in rows) > 0
    opened.evaluate("(r => { r.value = r.max; r.dispatchEvent(new Event('input')); })(document.getElementById('longest'))")
    opened.check("#survivors")
    for family in ("paper", "fischer", "anchored"):
        opened.select_option("#family", family)
        chosen = max(rows, key=lambda row: row.spanning_trees)
        upper = getattr(chosen, f"{family}_upper")
        possible = sum(row is chosen or getattr(row, f"{family}_lower") <= upper for row in rows)
        assert opened.locator("#actions tbody tr").count() == possible
        assert opened.inner_text("#count").startswith(f"{possible} of {len(rows)}")


@browser_test
def test_claims_can_be_filtered(opened: Any) -> None:
    claims = smallest_reproduction().claims
    for verdict in ("yes", "no"):
        opened.select_option("#verdict", verdict)
        expected = sum(claim.holds == (verdict == "yes") for claim in claims)
        assert opened.locator("#claims-table tbody tr:visible").count() == expected
    opened.select_option("#verdict", "")
    opened.select_option("#topic", "upper bound")
    assert opened.locator("#claims-table tbody tr:visible").count() == sum(c.topic == "upper bound" for c in claims) == 6


@browser_test
def test_nothing_is_wider_than_the_screen(opened: Any) -> None:
    assert opened.evaluate("document.documentElement.scrollWidth <= window.innerWidth")


@browser_test
def test_random_graphs_show_the_signature_that_is_chosen(opened: Any) -> None:
    opened.select_option("#graph-signature", "von_neumann")
    opened.uncheck("#per-pose")
    shown = opened.evaluate("document.getElementById('graph-plot').data.map((t) => t.x)")
    expected = [row.von_neumann for row in smallest_reproduction().random_graphs if row.num_poses == 20]
    assert shown == [expected, []]  # above the largest spectrum there is none
