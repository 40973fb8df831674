"""The page in a real browser: clicks, drags, the list, the front, downloads, two tabs at once, and a server that stops."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from browsers import browser_test, chromium
from topobelief.candidates.propose import CandidateRule
from topobelief.candidates.start import find_start
from topobelief.io.floor_plan import read_world
from topobelief.page import situation
from topobelief.page.server import PageServer

pytest.importorskip("numba")
from topobelief.cli.answers import Answers

PLACE_OF_GOAL = """(() => {
    const box = document.getElementById('map').getBoundingClientRect(), [u, v] = onScreen([0, 5]);
    return [box.left + u, box.top + v];
})()"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    with chromium() as started:
        yield started


@pytest.fixture
def served(office: Any) -> Iterator[PageServer]:
    graph, world = office.graph, read_world(office.map_file)
    start = find_start(graph)
    answers = Answers(graph, world, start, CandidateRule(num_vertices=200), 1.6, 60.0, max_evaluations=100)
    shown = situation.document("office", graph, world, start, [(name, name) for name in answers.models], trip=30.0)
    with PageServer(shown, answers) as server:
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True).start()
        yield server
        server.shutdown()


@pytest.fixture(params=[(1280, 900), (390, 844)], ids=["desktop", "phone"])
def tab(request: pytest.FixtureRequest, browser: Any, served: PageServer) -> Iterator[Any]:
    """The page, and afterwards: nothing was complained of."""
    width, height = request.param
    context = browser.new_context(viewport={"width": width, "height": height}, has_touch=width < 500, bypass_csp=True)
    opened, complaints = context.new_page(), list[str]()
    opened.on("console", lambda message: complaints.append(message.text))
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.goto(served.address)
    yield SimpleNamespace(page=opened, context=context, server=served)
    assert complaints == []
    context.close()


def answered(page: Any) -> None:
    page.wait_for_selector("#ways:not([hidden])", timeout=60_000)
    page.wait_for_selector("#stop", state="hidden", timeout=60_000)


@browser_test
def test_a_click_on_the_map_is_a_goal_and_its_ways_can_be_looked_at(tab: Any) -> None:
    page = tab.page
    page.mouse.click(*page.evaluate(PLACE_OF_GOAL))
    answered(page)
    assert abs(float(page.input_value("#goal-x"))) < 0.2
    assert page.inner_text("#headline").startswith("Drive path")
    assert "the best way found" in page.inner_text("#why")
    rows = page.locator("#list label")
    assert rows.count() > 2
    rows.first.hover()
    first = page.inner_text("#why")
    assert first.startswith(rows.first.inner_text().split(",")[0])
    page.mouse.move(1, 1)
    assert page.inner_text("#why") != first  # only a look: the chosen way is shown again
    rows.first.click()
    page.keyboard.press("ArrowDown")
    assert page.inner_text("#why") != first
    assert rows.nth(1).get_attribute("class").endswith("chosen")


@browser_test
def test_the_front_is_walked_along_by_keyboard(tab: Any) -> None:
    page = tab.page
    page.check("input[value=return]")
    page.fill("#limit", "24")
    page.click("#ask")
    answered(page)
    page.mouse.move(1, 1)  # the page scrolls to the slider, and a way that comes to lie under the mouse would be shown
    page.focus("#slider")
    page.keyboard.press("Home")
    assert page.inner_text("#why").startswith("staying")
    page.keyboard.press("End")
    last = page.inner_text("#why")
    assert not last.startswith("staying")


@browser_test
def test_a_list_of_candidates_is_compared_by_the_bounds_that_are_chosen(tab: Any) -> None:
    page = tab.page
    page.fill("#goal-x", "0")
    page.fill("#goal-y", "5")
    page.select_option("#compare", "20")
    page.select_option("#objective", "joint")
    page.select_option("#bounds", "fischer")
    page.click("#ask")
    answered(page)
    assert page.locator("#list label.possible, #list label.ruled-out").count() > 1
    assert page.is_hidden("#front")


@browser_test
def test_what_cannot_be_is_told_and_the_next_question_is_answered(tab: Any) -> None:
    page = tab.page
    page.click("#ask")
    assert "click the map" in page.inner_text("#state")
    page.fill("#goal-x", "5")
    page.fill("#goal-y", "5")  # within the pillar
    page.click("#ask")
    page.wait_for_selector("#state.failed", timeout=60_000)
    assert "expected" in page.inner_text("#state")
    page.fill("#goal-x", "0")
    page.click("#ask")
    answered(page)


@browser_test
def test_the_map_is_dragged_and_zoomed_without_asking(tab: Any) -> None:
    page = tab.page
    page.evaluate("document.getElementById('map').scrollIntoView()")
    before = page.evaluate(PLACE_OF_GOAL)
    box = page.locator("#map").bounding_box()
    u, v = box["x"] + box["width"] / 2, box["y"] + box["height"] / 3
    page.mouse.move(u, v)
    page.mouse.down()
    page.mouse.move(u + 40, v + 30, steps=4)
    page.mouse.up()
    after = page.evaluate(PLACE_OF_GOAL)
    assert [round(a - b) for a, b in zip(after, before, strict=True)] == [40, 30]
    page.click("#closer")
    page.click("#whole")
    assert page.evaluate(PLACE_OF_GOAL) == pytest.approx(before, abs=1)
    assert page.inner_text("#state") == ""


@browser_test
def test_ways_and_the_page_itself_are_downloaded(tab: Any, browser: Any, tmp_path: Path) -> None:
    page = tab.page
    page.mouse.click(*page.evaluate(PLACE_OF_GOAL))
    answered(page)
    with page.expect_download() as way:
        page.click("[data-format=csv]")
    way.value.save_as(tmp_path / "way.csv")
    assert (tmp_path / "way.csv").read_text().startswith("x,y,yaw\n10.0,10.0,")
    with page.expect_download() as saved:
        page.click("#save")
    saved.value.save_as(tmp_path / "decision.html")
    alone = browser.new_page()
    alone.goto((tmp_path / "decision.html").as_uri())
    assert alone.inner_text("#headline") == page.inner_text("#headline")
    assert alone.locator("#list label").count() == page.locator("#list label").count()
    assert alone.is_disabled("#ask")
    alone.close()


@browser_test
def test_two_tabs_have_their_own_answers_and_a_stopped_server_is_told(tab: Any) -> None:
    other = tab.context.new_page()
    other.goto(tab.server.address)
    tab.page.mouse.click(*tab.page.evaluate(PLACE_OF_GOAL))
    other.check("input[value=trip]")
    other.fill("#limit", "12")
    other.click("#ask")
    answered(tab.page)
    answered(other)
    assert tab.page.inner_text("#headline") != other.inner_text("#headline")
    tab.server.shutdown()
    tab.server.socket.close()
    other.click("#ask")
    other.wait_for_selector("#state.failed")
    assert "does not answer any more" in other.inner_text("#state")


def test_a_port_that_is_taken_and_a_world_that_is_not_said_are_errors(office: Any, topobelief: Any, served: PageServer) -> None:
    files = [str(office.graph_file), "--map", str(office.map_file)]
    taken = topobelief(["serve", *files, "--vertices", "50", "--port", str(served.server_address[1])])
    assert (taken.code, len(taken.err.splitlines())) == (2, 1)
    assert "choose another --host or --port" in taken.err
    nowhere = topobelief(["serve", str(office.graph_file)])
    assert nowhere.code == 2
    assert "--along-trajectory" in nowhere.err
