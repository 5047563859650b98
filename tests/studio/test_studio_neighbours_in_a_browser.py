"""The file by which a browser is opened leads it to studio's page, which then stays open."""

import threading
import time
import webbrowser
from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api")

from chromium import BROWSER

from evocity.studio.browser import opened_browser
from evocity.studio.server import running_server

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")


@pytest.mark.slow
def test_the_file_leads_to_the_page_which_loads_again(browser, night, monkeypatch):
    addresses, told = [], threading.Event()
    monkeypatch.setattr(webbrowser, "open", lambda url: (addresses.append(url), told.set()))
    with running_server(night) as server, opened_browser(server.url, server.opened):
        assert told.wait(120)
        page, refused = browser.new_page(), []
        page.on("response", lambda one: refused.append(one.url) if one.status >= 400 else None)
        page.goto(addresses[0])
        own = f"http://127.0.0.1:{server.port}/"
        page.wait_for_url(lambda url: url.startswith(own) and "token" not in url)
        page.get_by_text("generation 3", exact=False).first.wait_for()
        page.reload()
        page.get_by_text("generation 3", exact=False).first.wait_for()
        assert refused == []
        assert server.opened.is_set()
        page.close()
        until = time.monotonic() + 120
        while Path(addresses[0].removeprefix("file://")).exists():  # it has done its work
            assert time.monotonic() < until
            time.sleep(0.01)
