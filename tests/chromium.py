"""A browser without a window, for tests that drive a page."""

import contextlib
import shutil
from collections.abc import Iterator

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")


@contextlib.contextmanager
def started(*more: str) -> Iterator:
    """Chromium by Playwright, with ``more`` words of its command line."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", *more])
        with contextlib.closing(found):
            yield found
