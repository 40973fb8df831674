"""The server of the page: on this machine only unless told otherwise, without a network, without files of its own.

    GET  /                       the page
    POST /questions              a question; answered with its id and a first answer
    GET  /answers/ID?after=N     the answer, once it is newer than version N
    POST /answers/ID/stop        end with what there is
    GET  /answers/ID/page        the page with this answer in it, as one file

A request is refused where it names another host than this server (a page from elsewhere could otherwise reach it by a name that
resolves to this machine), is larger than `LARGEST` bytes, or carries no token. It may take `TIMEOUT` seconds to arrive.
"""

from __future__ import annotations

import json
import re
import secrets
import threading
from collections.abc import Callable, Mapping
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

from topobelief.errors import InvalidInputError, TopobeliefError
from topobelief.io.json_values import without_nan
from topobelief.page.desk import Answerer, BusyError, Desk
from topobelief.page.document import page_text
from topobelief.page.question import Question

LARGEST = 16_384
TIMEOUT = 10.0
LOOPBACK = ("127.0.0.1", "::1", "localhost")

_FIRST_WAIT = 0.25  # seconds for a first answer
_NEXT_WAIT = 1.0  # for a better one
_MOST_CONNECTIONS = 32
_ANSWER = re.compile(r"/answers/([0-9a-f]{32})(/stop|/page)?")


class PageServer(ThreadingHTTPServer):
    """Serves one situation until it is shut down.

    Parameters
    ----------
    situation
        As `situation.document` makes it.
    answerer
        Answers questions about it.
    host, port
        Where to listen; 0 for any free port. On another host than this machine's own, whoever opens the page needs `token`.
    """

    daemon_threads = True

    def __init__(self, situation: Mapping[str, object], answerer: Answerer, *, host: str = "127.0.0.1", port: int = 0) -> None:
        self.situation, self.desk = situation, Desk(answerer)
        self.token = secrets.token_urlsafe(16)
        self.needs_token = host not in LOOPBACK
        self._free = threading.BoundedSemaphore(_MOST_CONNECTIONS)
        super().__init__((host, port), _Handler)

    @property
    def address(self) -> str:
        """What to open in a browser."""
        host, port = self.server_address[:2]
        return f"http://{host!s}:{port}/{f'?token={self.token}' if self.needs_token else ''}"

    def process_request(self, request: object, client_address: object) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """As usual, but no more than so many at once."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)  # pyright: ignore[reportArgumentType]
            return
        super().process_request(request, client_address)  # pyright: ignore[reportArgumentType]

    def process_request_thread(self, request: object, client_address: object) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Release the place when done."""
        try:
            super().process_request_thread(request, client_address)  # pyright: ignore[reportArgumentType]
        finally:
            self._free.release()

    def server_close(self) -> None:
        """End all questions too."""
        self.desk.close()
        super().server_close()


class _RefusedError(Exception):
    """A request that is not answered, with its status and why."""

    def __init__(self, status: HTTPStatus, why: str) -> None:
        super().__init__(why)
        self.status = status


class _Handler(BaseHTTPRequestHandler):
    server: PageServer  # pyright: ignore[reportIncompatibleVariableOverride]
    timeout = TIMEOUT

    def do_GET(self) -> None:
        self._respond(self._get)

    def do_POST(self) -> None:
        self._respond(self._post)

    def version_string(self) -> str:
        """No versions of what runs here."""
        return "topobelief"

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing: whoever started the server reads its own lines on the terminal."""

    def _respond(self, respond: Callable[[], None]) -> None:
        """Answer; whatever is wrong with a request becomes a status and a line."""
        try:
            self._check_host()
            respond()
        except _RefusedError as error:
            self._send_json({"error": str(error)}, error.status)
        except BusyError as error:
            self._send_json({"error": str(error)}, HTTPStatus.SERVICE_UNAVAILABLE)
        except TopobeliefError as error:
            self._send_json({"error": str(error)}, HTTPStatus.BAD_REQUEST)
        except (ConnectionError, TimeoutError):
            self.close_connection = True

    def _get(self) -> None:
        parts = urlsplit(self.path)
        if parts.path == "/":
            self._check_token(parse_qs(parts.query).get("token", [""])[0] if self.server.needs_token else self.server.token)
            self._send_page(*page_text(self.server.situation, token=self.server.token))
            return
        self._check_token(self._bearer)
        key, rest = self._answer_of(parts.path)
        if rest == "/page":
            answer = self.server.desk.answer(key, after=-1, wait=0.0)
            self._send_page(*page_text(self.server.situation, answer), name="decision.html")
        elif rest is None:
            after = parse_qs(parts.query).get("after", ["-1"])[0]
            version = int(after) if re.fullmatch(r"-?\d{1,9}", after) else -1
            self._send_json(self.server.desk.answer(key, after=version, wait=_NEXT_WAIT))
        else:
            raise _RefusedError(HTTPStatus.METHOD_NOT_ALLOWED, "expected POST")

    def _post(self) -> None:
        self._check_token(self._bearer)
        body = self._body()
        if self.path == "/questions":
            try:
                question = Question.read(json.loads(body))
            except (ValueError, RecursionError):
                raise InvalidInputError("expected a question as JSON, got something else") from None
            key = self.server.desk.ask(question)
            self._send_json(self.server.desk.answer(key, after=0, wait=_FIRST_WAIT))
            return
        key, rest = self._answer_of(self.path)
        if rest != "/stop":
            raise _RefusedError(HTTPStatus.METHOD_NOT_ALLOWED, "expected GET")
        self.server.desk.stop(key)
        self._send_json({})

    def _answer_of(self, path: str) -> tuple[str, str | None]:
        found = _ANSWER.fullmatch(path)
        if found is None:
            raise _RefusedError(HTTPStatus.NOT_FOUND, "expected a page of this server, got another path")
        return found[1], found[2]

    def _body(self) -> bytes:
        length = self.headers.get("Content-Length", "")
        if self.headers.get_content_type() != "application/json" or not re.fullmatch(r"\d{1,9}", length):
            raise _RefusedError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "expected JSON of a stated length")
        if int(length) > LARGEST:
            self.close_connection = True
            raise _RefusedError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"expected at most {LARGEST} bytes, got {length}")
        return self.rfile.read(int(length))

    @property
    def _bearer(self) -> str:
        return self.headers.get("Authorization", "").removeprefix("Bearer ")

    def _check_token(self, token: str) -> None:
        if not secrets.compare_digest(token.encode(), self.server.token.encode()):
            raise _RefusedError(HTTPStatus.FORBIDDEN, "expected the token that the server printed when it started")

    def _check_host(self) -> None:
        name = urlsplit(f"//{self.headers.get('Host', '')}").hostname
        if not self.server.needs_token and name not in LOOPBACK:
            raise _RefusedError(HTTPStatus.FORBIDDEN, "expected a request to this machine by its own name")

    def _send_json(self, document: Mapping[str, object], status: HTTPStatus = HTTPStatus.OK) -> None:
        content = json.dumps(without_nan(document), allow_nan=False, separators=(",", ":")).encode()
        self._send(content, "application/json", status, {})

    def _send_page(self, text: str, nonce: str, *, name: str | None = None) -> None:
        own = f"'nonce-{nonce}'"
        loads = f"default-src 'none'; script-src {own}; style-src {own}; connect-src 'self'; img-src data:"
        headers = {"Content-Security-Policy": f"{loads}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"}
        if name is not None:
            headers["Content-Disposition"] = f'attachment; filename="{name}"'
        self._send(text.encode(), "text/html; charset=utf-8", HTTPStatus.OK, headers)

    def _send(self, content: bytes, kind: str, status: HTTPStatus, headers: Mapping[str, str]) -> None:
        self.send_response(status)
        always = {"X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer", "Cache-Control": "no-store"}
        for header, value in {"Content-Type": kind, "Content-Length": str(len(content)), **always, **headers}.items():
            self.send_header(header, value)
        self.end_headers()
        self.wfile.write(content)
