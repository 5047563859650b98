"""Opening studio in the browser by a file that holds the address.

Other accounts of the machine can read the command line of every program, and so of the browser. The
address with its token must not stand there.
"""

import contextlib
import html
import os
import threading
import webbrowser
from collections.abc import Iterator
from functools import partial

from evocity.files import ProcessFolder

_PAGE = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="referrer" content="no-referrer">
<meta http-equiv="refresh" content="0; url={url}">
<title>evocity studio</title>
<a href="{url}">evocity studio</a>
</html>
"""


@contextlib.contextmanager
def opened_browser(url: str, opened: threading.Event) -> Iterator[None]:
    """Open a browser at ``url``, by a file that only this user can read. The file stays until
    ``opened`` is set, and at most until the end of the block."""
    try:
        folder = ProcessFolder("evocity-browser-")
    except OSError:  # the user still has the printed address
        yield
        return
    path = folder.path / "studio.html"

    def remove_used() -> None:
        opened.wait()
        path.unlink(missing_ok=True)

    try:
        with contextlib.suppress(OSError):
            handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with open(handle, "w", encoding="utf-8") as file:
                file.write(_PAGE.format(url=html.escape(url)))
            # some browsers return only when they end
            for act in (partial(webbrowser.open, path.as_uri()), remove_used):
                threading.Thread(target=act, daemon=True).start()
        yield
    finally:
        folder.remove()
