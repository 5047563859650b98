"""A browser without a window, for tests that drive a page."""

import contextlib
import shutil
from collections.abc import Callable, Iterator

#: WebGL without a graphics card; pages are put together without it too, which is faster then.
WITHOUT_CARD = (
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-gpu-compositing",
)
BROWSER = shutil.which("chromium") or shutil.which("google-chrome")
# Each new window loads two pages of the address bar, which take longer than the tests' own, and a
# process for a page to come.
_SPARE = ("WebUIOmniboxPopup", "WebUIOmniboxAimPopup", "SpareRendererForSitePerProcess")


@contextlib.contextmanager
def started() -> Iterator:
    """Chromium by Playwright."""
    from playwright.sync_api import sync_playwright

    words = ["--no-sandbox", f"--disable-features={','.join(_SPARE)}", *WITHOUT_CARD]
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=BROWSER, args=words)
        with contextlib.closing(found):
            for name in ("new_context", "new_page"):
                setattr(found, name, _patient(getattr(found, name)))
            yield found


def _patient(make: Callable) -> Callable:
    """``make`` a context or page that waits for a busy machine, four times as long as usual."""

    def made(*given, **how):
        one = make(*given, **how)
        one.set_default_timeout(120_000)
        return one

    return made
