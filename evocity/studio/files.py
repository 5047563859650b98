"""The page's own files, in memory: what is none of these has no address."""

from functools import cache
from pathlib import Path

from evocity.viewer.joined import PAGE as VIEWER

PAGE = Path(__file__).parent / "page"
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}


@cache
def files() -> dict[str, tuple[str, bytes]]:
    """Address -> kind and content. The page itself is ``/``; its modules, and those of
    `evocity.viewer`, which they import, are side by side in ``/page``: no two have one name."""
    found: dict[str, tuple[str, bytes]] = {}
    for path in sorted([*PAGE.iterdir(), *VIEWER.iterdir()]):
        if path.suffix in _KINDS:
            address = "/" if path.name == "index.html" else f"/page/{path.name}"
            assert address not in found, f"two files of the page are called {path.name}"
            found[address] = (_KINDS[path.suffix], path.read_bytes())
    return found


__all__ = ["PAGE", "files"]
