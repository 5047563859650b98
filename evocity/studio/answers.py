"""Answers of studio: how a request is parsed and a result becomes a response, and the page's own
files, which stay in memory."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from evocity.errors import EvocityError
from evocity.studio.request_fields import Body, RequestError, fault_of, parse_body
from evocity.studio.run_watcher import frame
from evocity.studio.runs import OpenRun
from evocity.viewer import module_bundle
from evocity.viewer.sheet import Sheet

BYTES = "application/octet-stream"
_PAGE = Path(__file__).parent / "page"
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}

#: Plain values (JSON), bytes, plain values with bytes (`frame`), pictures, or a whole response.
Answer = dict | bytes | tuple[dict, bytes] | Sheet | Response
Handler = Callable[[Request], Answer]
RunHandler = Callable[[OpenRun, Request], Answer]
RunChange = Callable[[OpenRun, Body], Answer]


def parse_change(kind: type[Body], change: Callable) -> Callable[..., Answer]:
    """Return a handler that passes the body of a request on, parsed; last of its arguments."""

    def answer(*arguments) -> Answer:
        *before, request = arguments
        return change(*before, parse_body(kind, request.state.body))

    return answer


def parse_query(kind: type[Body], answer: Callable[[OpenRun, Body], Answer]) -> RunHandler:
    """Return a handler for a question with the JSON ``request`` in its query."""

    def handler(run: OpenRun, request: Request) -> Answer:
        return answer(run, parse_body(kind, request.query_params.get("request", "").encode()))

    return handler


def answer_safely(answer: Handler):
    """Return a handler that answers in a thread, with errors in three parts."""

    async def answer_in_thread(request: Request) -> Response:
        if request.method == "POST":
            request.state.body = await request.body()
        try:
            return await run_in_threadpool(lambda: _response(answer(request)))
        except EvocityError as error:
            status = 400 if isinstance(error, RequestError) else 409
            return JSONResponse({"error": fault_of(error)}, status)

    return answer_in_thread


def _response(answer: Answer) -> Response:
    if isinstance(answer, Response):
        return answer
    if isinstance(answer, dict):
        return JSONResponse(answer)
    if isinstance(answer, Sheet):
        answer = (answer.about, answer.image)
    content = answer if isinstance(answer, bytes) else frame(*answer)
    return Response(content, media_type=BYTES)


# -- the page's own files -------------------------------------------------------------------------


@cache
def page_files() -> dict[str, tuple[str, bytes]]:
    """Return the kind and content of each file of the page, by address. The page is ``/``."""
    files = {f"/page/{name}": text.encode() for name, text in module_bundle.files().items()}
    for path in sorted(_PAGE.iterdir()):
        address = "/" if path.name == "index.html" else f"/page/{path.name}"
        if path.suffix in _KINDS:
            assert address not in files, f"two files of the page have the name {path.name}"
            files[address] = path.read_bytes()
    return {
        address: (_KINDS[Path(address).suffix or ".html"], content)
        for address, content in files.items()
    }


def file_answer(kind: str, content: bytes):
    async def answer(request: Request) -> Response:
        return Response(content, headers={"content-type": kind})

    return answer
