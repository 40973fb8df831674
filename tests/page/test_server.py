"""The server of the page, over real connections, with an answerer that is told what to do."""

from __future__ import annotations

import http.client
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from topobelief.errors import PlanningError
from topobelief.page.desk import Publish
from topobelief.page.question import Question
from topobelief.page.server import LARGEST, PageServer

SITUATION = {"name": "<script>alert(1)</script>.g2o"}
QUESTION = {"goal": [1, 2]}


@contextmanager
def served(answerer: Callable[..., None] | None = None, **options: Any) -> Iterator[PageServer]:
    def at_once(_: Question, publish: Publish, __: Callable[[], bool]) -> None:
        publish({"headline": "Drive."})

    with PageServer(SITUATION, answerer or at_once, **options) as server:
        thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02}, daemon=True)
        thread.start()
        yield server
        server.shutdown()


def call(
    server: PageServer, method: str, path: str, body: object = None, *, headers: dict[str, str] | None = None
) -> tuple[int, Any]:
    connection = http.client.HTTPConnection("127.0.0.1", server.server_address[1], timeout=20)
    content = None if body is None else body if isinstance(body, bytes) else json.dumps(body).encode()
    usual = {"Content-Type": "application/json", "Authorization": f"Bearer {server.token}"}
    connection.request(method, path, content, {**usual, **(headers or {})})
    response = connection.getresponse()
    text = response.read().decode()
    connection.close()
    return response.status, json.loads(text) if response.headers.get_content_type() == "application/json" else text


def waited(server: PageServer, answer: dict[str, Any]) -> dict[str, Any]:
    while answer["state"] == "working":
        _, answer = call(server, "GET", f"/answers/{answer['id']}?after={answer['version']}")
    return answer


def test_a_question_is_answered() -> None:
    with served() as server:
        status, answer = call(server, "POST", "/questions", QUESTION)
        assert status == 200
        answer = waited(server, answer)
        assert (answer["headline"], answer["state"], answer["question"]["goal"]) == ("Drive.", "done", [1.0, 2.0])


def test_the_page_holds_what_it_shows_and_nothing_of_a_name_runs() -> None:
    with served() as server:
        status, page = call(server, "GET", "/")
        assert status == 200
        assert "<script>alert(1)" not in page
        assert server.token in page


def test_an_answer_is_saved_as_a_page_without_the_token() -> None:
    with served() as server:
        answer = waited(server, call(server, "POST", "/questions", QUESTION)[1])
        status, page = call(server, "GET", f"/answers/{answer['id']}/page")
        assert status == 200
        assert "Drive." in page
        assert server.token not in page


def test_answers_get_better_and_a_reader_waits_for_the_next() -> None:
    go = threading.Event()

    def twice(_: Question, publish: Publish, __: Callable[[], bool]) -> None:
        publish({"headline": "first"})
        go.wait(20)
        publish({"headline": "second"})

    with served(twice) as server:
        _, first = call(server, "POST", "/questions", QUESTION)
        assert (first["headline"], first["state"]) == ("first", "working")
        go.set()
        assert waited(server, first)["headline"] == "second"


def test_an_error_is_told_and_the_next_question_answered() -> None:
    def picky(question: Question, publish: Publish, _: Callable[[], bool]) -> None:
        if question.goal == (0.0, 0.0):
            raise PlanningError("expected a goal in free space, got (0, 0)")
        publish({"headline": "Drive."})

    with served(picky) as server:
        failed = waited(server, call(server, "POST", "/questions", {"goal": [0, 0]})[1])
        assert (failed["state"], failed["error"]) == ("failed", "expected a goal in free space, got (0, 0)")
        assert waited(server, call(server, "POST", "/questions", QUESTION)[1])["headline"] == "Drive."


def test_a_question_ends_when_it_is_stopped_and_few_are_worked_on_at_once() -> None:
    def patient(_: Question, publish: Publish, unwanted: Callable[[], bool]) -> None:
        while not unwanted():
            time.sleep(0.01)
        publish({"headline": "what there was"})

    with served(patient) as server:
        asked = [call(server, "POST", "/questions", QUESTION) for _ in range(5)]
        assert [status for status, _ in asked] == [200] * 4 + [503]
        for _, answer in asked[:4]:
            assert call(server, "POST", f"/answers/{answer['id']}/stop", {})[0] == 200
            assert waited(server, answer)["headline"] == "what there was"
        assert call(server, "POST", "/questions", QUESTION)[0] == 200


@pytest.mark.parametrize(
    ("method", "path", "body", "headers", "status"),
    [
        ("GET", "/", None, {"Host": "evil.example"}, 403),
        ("POST", "/questions", QUESTION, {"Authorization": "Bearer wrong"}, 403),
        ("POST", "/questions", QUESTION, {"Authorization": ""}, 403),
        ("POST", "/questions", QUESTION, {"Content-Type": "text/plain"}, 415),
        ("POST", "/questions", b"{" * 9000, {}, 400),
        ("POST", "/questions", b" " * (LARGEST + 1), {}, 413),
        ("POST", "/questions", {"goal": [1]}, {}, 400),
        ("GET", "/../../etc/passwd", None, {}, 404),
        ("GET", "/answers/" + "0" * 32, None, {}, 400),
        ("POST", "/answers/" + "0" * 32 + "/page", {}, {}, 405),
        ("PUT", "/questions", QUESTION, {}, 501),
    ],
)
def test_what_is_wrong_is_refused_and_the_server_lives(
    method: str, path: str, body: object, headers: dict[str, str], status: int
) -> None:
    with served() as server:
        assert call(server, method, path, body, headers=headers)[0] == status
        assert call(server, "POST", "/questions", QUESTION)[0] == 200


def test_who_opens_a_page_for_others_needs_the_token() -> None:
    with served(host="0.0.0.0") as server:
        assert call(server, "GET", "/")[0] == 403
        assert call(server, "GET", f"/?token={server.token}", headers={"Host": "robot:80"})[0] == 200
        assert server.token in server.address


def test_silent_connections_do_not_keep_others_out_for_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("topobelief.page.server._Handler.timeout", 0.3)
    with served() as server:
        silent = [socket.create_connection(server.server_address[:2]) for _ in range(40)]
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline:
            try:
                assert call(server, "GET", "/")[0] == 200
                break
            except (ConnectionError, http.client.HTTPException):
                time.sleep(0.05)
        else:
            pytest.fail("the server did not recover")
        for connection in silent:
            connection.close()
