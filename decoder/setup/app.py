"""The set-up page's application and server: which question is answered where, on this machine, until Ctrl-C."""

from __future__ import annotations

import asyncio
import json
import logging
import secrets
import socket
import sys
import threading
from collections.abc import AsyncGenerator, Callable, Generator
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from http import HTTPStatus
from importlib.resources import files
from typing import TypeVar

import uvicorn
from starlette.applications import Starlette
from starlette.background import BackgroundTask
from starlette.concurrency import iterate_in_threadpool, run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.types import Receive

from decoder.panel.errors import DecoderError, DescriptionError, PictureError
from decoder.setup import answers, requests
from decoder.setup.drafts import Stale, Superseded
from decoder.setup.guard import BodyTooLarge, Guard
from decoder.setup.proposing.advice import advice_answer
from decoder.setup.proposing.trying import tried_search
from decoder.setup.requests import NeedlesQuestion, NotUnderstood, Question, TrialQuestion, question
from decoder.setup.session import NotValid, SavedElsewhere, SetupSession, WouldReplace
from decoder.setup.views import Part, part_view, whole_view
from flight_file.errors import FlightFileError
from flight_file.untrusted import printable

KINDS = {
    "html": "text/html; charset=utf-8",
    "css": "text/css; charset=utf-8",
    "js": "text/javascript; charset=utf-8",
    "svg": "image/svg+xml",
}
PAGE = "index.html"
MANY = 8
TRIAL, ADVICE = "/api/trial", "/api/advice"
FOUND = "/api/found"
_log = logging.getLogger(__name__)
Turned = TypeVar("Turned", TrialQuestion, NeedlesQuestion, requests.TurningQuestion)

ADDRESS = "127.0.0.1"
GRACE_S = 1
# Answers that somebody waits for must not queue behind a trial of a gauge in another thread.
SWITCH_S = 0.0005


class Turns:
    """The latest question of each tab and kind; all earlier ones are stale."""

    def __init__(self) -> None:
        self._latest: dict[str, int] = {}
        self._lock = threading.Lock()

    def take(self, name: str) -> Stale:
        """Register a question; return a function that tells whether a later one has come."""
        with self._lock:
            number = self._latest[name] = self._latest.get(name, 0) + 1
        return lambda: self._latest[name] != number


def page_files() -> dict[str, bytes]:
    """Read the page's own files by name; nothing else can be requested."""
    return {
        entry.name: entry.read_bytes()
        for entry in files("decoder.setup").joinpath("page").iterdir()
        if entry.name.rpartition(".")[2] in KINDS
    }


def setup_app(session: SetupSession) -> Starlette:
    """Make the application, to be put behind a `Guard`."""
    return Starlette(
        routes=[
            *_page_routes(),
            *_session_routes(session),
            *_picture_routes(session),
            *_question_routes(session),
        ],
        exception_handlers={
            BodyTooLarge: _told(HTTPStatus.REQUEST_ENTITY_TOO_LARGE),
            NotUnderstood: _told(HTTPStatus.BAD_REQUEST),
            SavedElsewhere: _declined("elsewhere"),
            NotValid: _declined("invalid"),
            WouldReplace: _declined("replace"),
            DecoderError: _declined("cannot"),
            FlightFileError: _declined("cannot"),
            Superseded: _superseded,
            HTTPException: _no_such,
            Exception: _failed,
        },
    )


def _page_routes() -> list[Route]:
    pages = page_files()

    async def page(request: Request) -> Response:
        name = request.path_params.get("name", PAGE)
        if name not in pages:
            return JSONResponse({"error": "there is no such file"}, HTTPStatus.NOT_FOUND)
        return Response(pages[name], media_type=KINDS[name.rpartition(".")[2]])

    return [Route("/", page), Route("/page/{name}", page)]


def _picture_routes(session: SetupSession) -> list[Route]:
    async def size(request: Request) -> Response:
        return JSONResponse(await run_in_threadpool(answers.picture_answer, session, request.path_params["key"]))

    async def image(view: Callable[[str], bytes], key: str) -> Response:
        try:
            return Response(await run_in_threadpool(view, key), media_type="image/jpeg")
        except (PictureError, FlightFileError) as error:  # an <img> shows no sentence, but must fail
            return JSONResponse({"error": str(error)}, HTTPStatus.NOT_FOUND)

    async def whole(request: Request) -> Response:
        return await image(partial(whole_view, session.store), request.path_params["key"])

    async def part(request: Request) -> Response:
        box = _box(request)
        return await image(lambda key: part_view(session.store, key, box), request.path_params["key"])

    return [
        Route("/api/pictures/{key}/size", size),
        Route("/api/pictures/{key}/whole", whole),
        Route("/api/pictures/{key}/part", part),
    ]


def _session_routes(session: SetupSession) -> list[Route]:
    async def begin(_request: Request) -> Response:
        return JSONResponse(await run_in_threadpool(answers.session_answer, session))

    async def ping(_request: Request) -> Response:
        return JSONResponse({"revision": session.revision})

    async def save(request: Request) -> Response:
        asked = await question(request, requests.SaveQuestion)
        revision = session.accept_others() if asked.over else asked.revision
        saved = await run_in_threadpool(
            session.save, asked.document, asked.picture, revision, replaces=asked.replace is True
        )
        return JSONResponse({"revision": saved, "target": str(session.target)})

    return [
        Route("/api/session", begin),
        Route("/api/ping", ping),
        Route("/api/panel", save, methods=["PUT"]),
    ]


def _question_routes(session: SetupSession) -> list[Route]:
    turns = Turns()
    # A trial uses a whole core: run one at a time, so that another core is free for answers that somebody waits for.
    one_trial, many = asyncio.Semaphore(1), asyncio.Semaphore(MANY)

    def plain(path: str, model: type[Question], answer: Callable[[SetupSession, Question], answers.Answer]) -> Route:
        async def handler(request: Request) -> Response:
            asked = await question(request, model)
            return JSONResponse(await run_in_threadpool(answer, session, asked))

        return Route(path, handler, methods=["POST"])

    async def unwrap(request: Request) -> Response:
        asked = await question(request, requests.UnwrapQuestion)
        turns.take(f"{ADVICE} {asked.tab}")
        turns.take(f"{TRIAL} {asked.tab}")  # cancels a trial while somebody draws; it is repeated when they pause
        return JSONResponse(await run_in_threadpool(answers.unwrap_answer, session, asked))

    def in_turn(
        path: str,
        model: type[Turned],
        answer: Callable[[SetupSession, Turned, Stale], answers.Answer],
        room: asyncio.Semaphore,
    ) -> Route:
        async def handler(request: Request) -> Response:
            asked = await question(request, model)
            stale = turns.take(f"{path} {asked.tab}")
            if path == TRIAL:  # a trial must not queue behind advice on an earlier draft, which is asked for again
                turns.take(f"{ADVICE} {asked.tab}")
            async with room:
                return JSONResponse(await run_in_threadpool(answer, session, asked, stale))

        return Route(path, handler, methods=["POST"])

    return [
        _search(session, turns),
        Route("/api/unwrap", unwrap, methods=["POST"]),
        plain("/api/rim", requests.RimQuestion, answers.rim_answer),
        plain("/api/mark", requests.MarkQuestion, answers.mark_answer),
        plain("/api/planes", requests.PlaneQuestion, answers.planes_answer),
        plain("/api/check", requests.DraftQuestion, answers.check_answer),
        plain("/api/paste", requests.PasteQuestion, answers.paste_answer),
        in_turn("/api/needles", requests.NeedlesQuestion, answers.needles_answer, many),
        in_turn("/api/turning", requests.TurningQuestion, answers.turning_answer, many),
        in_turn(TRIAL, requests.TrialQuestion, answers.trial_answer, one_trial),
        in_turn(ADVICE, requests.TrialQuestion, advice_answer, one_trial),
    ]


class _Along(StreamingResponse):
    """An answer sent line by line; `gone` is set as soon as nobody listens, even during a long step."""

    def __init__(self, lines: AsyncGenerator[str, None], gone: threading.Event, over: BackgroundTask) -> None:
        super().__init__(lines, media_type="application/x-ndjson", background=over)
        self._gone = gone

    async def listen_for_disconnect(self, receive: Receive) -> None:
        """Wait until nobody listens any more, or the answer is complete."""
        await super().listen_for_disconnect(receive)
        self._gone.set()


def _search(session: SetupSession, turns: Turns) -> Route:
    """Search for dials, one search at a time: each step is a line of the answer, sent as soon as it is done."""
    one_search = asyncio.Semaphore(1)

    def told(asked: requests.FoundQuestion, stale: Stale) -> Generator[answers.Answer, None, None]:
        try:
            for step in tried_search(session, asked.document, asked.picture, stale):
                yield answers.found_answer(session, asked, step)
        except Superseded:
            return
        except (DecoderError, FlightFileError) as error:
            yield {"error": str(error)}

    async def handler(request: Request) -> Response:
        asked = await question(request, requests.FoundQuestion)
        later, gone = turns.take(f"{FOUND} {asked.tab}"), threading.Event()

        def stale() -> bool:
            return gone.is_set() or later()

        async def lines() -> AsyncGenerator[str, None]:
            async with one_search:
                with closing(told(asked, stale)) as steps:
                    async for answer in iterate_in_threadpool(steps):
                        yield f"{json.dumps(answer)}\n"

        answer = lines()

        # Even if nobody listens any more, the search has ended, and the next one may begin.
        async def over() -> None:
            await answer.aclose()

        return _Along(answer, gone, BackgroundTask(over))

    return Route(FOUND, handler, methods=["POST"])


def _box(request: Request) -> Part:
    try:
        numbers = [int(request.query_params[name]) for name in ("left", "top", "width", "height", "wanted")]
    except (KeyError, ValueError) as error:
        raise NotUnderstood("the request was not understood: a part needs left, top, width, height, wanted") from error
    left, top, width, height, wanted = numbers
    return Part(left, top, max(width, 1), max(height, 1), min(max(wanted, 1), 4096))


def _told(status: int) -> Callable[[Request, Exception], Response]:
    def handler(_request: Request, error: Exception) -> Response:
        return JSONResponse({"error": str(error)}, status)

    return handler


def _declined(why: str) -> Callable[[Request, Exception], Response]:
    """Answer a question that was understood with the reason why it cannot be fulfilled."""

    def handler(_request: Request, error: Exception) -> Response:
        problems = [{"path": path, "problem": problem} for path, problem in _problems(error)]
        return JSONResponse({"declined": why, "error": str(error), "problems": problems})

    return handler


def _problems(error: Exception) -> list[tuple[str, str]]:
    if isinstance(error, NotValid):
        return [(each.path, each.problem) for each in error.problems]
    return [(error.path, error.problem)] if isinstance(error, DescriptionError) else []


def _superseded(_request: Request, _error: Exception) -> Response:
    return Response(status_code=HTTPStatus.NO_CONTENT)


def _no_such(_request: Request, error: Exception) -> Response:
    status = error.status_code if isinstance(error, HTTPException) else HTTPStatus.NOT_FOUND
    return JSONResponse({"error": f"the page asks nothing like that ({HTTPStatus(status).phrase.lower()})"}, status)


def _failed(request: Request, error: Exception) -> Response:
    """Answer a fault of the program with a sentence; the terminal shows the details."""
    _log.error("%s failed", printable(request.url.path), exc_info=error)
    sentence = "the program failed at this; what it was doing is in the terminal where it was started"
    return JSONResponse({"error": sentence}, HTTPStatus.INTERNAL_SERVER_ERROR)


@dataclass(frozen=True, slots=True)
class SetupServer:
    """A server that is already listening; `url` is the address of its page."""

    server: uvicorn.Server
    listening: socket.socket
    url: str

    def run(self) -> None:
        """Serve until it is told to end."""
        before = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_S)
        try:
            with suppress(KeyboardInterrupt):  # the normal end of a page
                self.server.run(sockets=[self.listening])
        finally:
            sys.setswitchinterval(before)
            self.listening.close()


def setup_server(session: SetupSession) -> SetupServer:
    """Make the server of a session's page."""
    listening = socket.socket()
    listening.bind((ADDRESS, 0))
    listening.listen()  # before anybody is told the address
    port = listening.getsockname()[1]
    token = secrets.token_urlsafe(24)
    app = Guard(setup_app(session), token, (f"{ADDRESS}:{port}", f"localhost:{port}"))
    config = uvicorn.Config(
        app, log_level="critical", access_log=False, lifespan="off", ws="none", server_header=False,
        timeout_graceful_shutdown=GRACE_S,
    )  # fmt: skip
    return SetupServer(uvicorn.Server(config), listening, f"http://{ADDRESS}:{port}/{token}/")
