"""A browser without a window, for tests that drive a page."""

import contextlib
import shutil
from collections.abc import Iterator

BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
# Each new window loads two pages of the address bar, which take longer than the tests' own, and a
# process for a page to come.
_SPARE = ("WebUIOmniboxPopup", "WebUIOmniboxAimPopup", "SpareRendererForSitePerProcess")


@contextlib.contextmanager
def started(*more: str) -> Iterator:
    """Chromium by Playwright, with ``more`` words of its command line."""
    from playwright.sync_api import sync_playwright

    words = ["--no-sandbox", f"--disable-features={','.join(_SPARE)}", *more]
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=BROWSER, args=words)
        with contextlib.closing(found):
            yield found
