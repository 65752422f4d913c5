"""The viewer's page, as a browser of this machine gets it."""

import re
import socket
import time
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest

from cell.recording.viewer import free_port, viewer_process
from cell.recording.web_page import guarded_page


@pytest.fixture(scope="module")
def served():
    """The viewer's own page, which talks to others, and the guarded one: two addresses."""
    web_port = free_port()
    with (viewer_process("--serve-web", "--port", str(free_port()), "--web-viewer-port",
                         str(web_port)), guarded_page(web_port) as page):
        deadline = time.monotonic() + 60.0
        while not listening(web_port) and time.monotonic() < deadline:
            time.sleep(0.1)
        yield f"http://127.0.0.1:{web_port}/", f"http://127.0.0.1:{page}/"


def listening(port):
    with socket.socket() as trial:
        return trial.connect_ex(("127.0.0.1", port)) == 0


@pytest.mark.parametrize("name", ["", "re_viewer.js", "re_viewer_bg.wasm"])
def test_everything_is_handed_on_with_a_policy_for_this_machine_alone(served, name):
    bare, guarded = served
    with urlopen(bare + name) as page:  # its server does one thing after the other
        content = page.read()
    with urlopen(guarded + name) as again:
        assert again.read() == content
    assert again.headers["Content-Type"] == page.headers["Content-Type"]
    assert "Content-Security-Policy" not in page.headers
    policy = again.headers["Content-Security-Policy"]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'self'"
    assert set(re.findall(r"[^\s;]*://[^\s;]+|\*", policy)) == {"http://127.0.0.1:*"}
    assert "http://127.0.0.1:*" in rules["connect-src"]  # where the recording comes from


def test_the_page_itself_would_ask_others(served):
    """If ever it does not, the guard has no work left."""
    with urlopen(served[0]) as page:
        assert b"https://fonts.googleapis.com" in page.read()


@pytest.mark.parametrize("path", ["/nothing", "@example.invalid/", "//example.invalid/"])
def test_it_fetches_from_the_viewer_and_from_nowhere_else(served, path):
    port = int(served[1].split(":")[2].strip("/"))
    with socket.create_connection(("127.0.0.1", port)) as browser:
        browser.sendall(f"GET {path} HTTP/1.0\r\n\r\n".encode())
        answer = browser.makefile("rb").read()
    assert answer.split()[1] in (b"404", b"400", b"502")


def test_a_viewer_that_has_gone_is_said():
    with guarded_page(free_port()) as page, pytest.raises(HTTPError, match="502"):
        urlopen(f"http://127.0.0.1:{page}/")
