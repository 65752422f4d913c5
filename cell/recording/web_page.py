"""The viewer's page for browsers of this machine, kept from talking to anybody else.

The page that the viewer serves asks for fonts and for news and sends usage data, and cannot be told
otherwise. So it is handed on with a content security policy, which every browser enforces: code,
data and pictures from this machine alone.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from http.client import HTTPConnection, HTTPException
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

from cell.recording.viewer import LOOPBACK

POLICY = "; ".join((
    "default-src 'self'", "script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'",
    "style-src 'self' 'unsafe-inline'", "img-src 'self' data: blob:",
    f"connect-src 'self' data: blob: http://{LOOPBACK}:*", "worker-src 'self' blob:",
    "object-src 'none'", "base-uri 'none'", "form-action 'none'"))
HANDED_ON = ("Content-Type", "rerun-final-length")  # the latter is for the page's progress bar
PATIENCE_S = 30.0


@contextmanager
def guarded_page(web_port: int) -> Iterator[int]:
    """Hand on what is served on a port of the loopback interface; gives the port to open."""

    class Guarded(_Guarded):
        behind = web_port

    with ThreadingHTTPServer((LOOPBACK, 0), Guarded) as server:
        thread = Thread(target=server.serve_forever, name="page", daemon=True)
        thread.start()
        try:
            yield server.server_port
        finally:
            server.shutdown()
            thread.join()


class _Guarded(BaseHTTPRequestHandler):
    behind: int

    def do_GET(self) -> None:
        """Ask the viewer's own server, and add the policy."""
        asked = HTTPConnection(LOOPBACK, self.behind, timeout=PATIENCE_S)
        try:
            asked.request("GET", self.path)
            answer = asked.getresponse()
            content = answer.read()
        except (OSError, HTTPException):
            self.send_error(502, "the viewer does not answer")
            return
        finally:
            asked.close()
        self.send_response(answer.status)
        for name in HANDED_ON:
            if (value := answer.getheader(name)) is not None:
                self.send_header(name, value)
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *_: object) -> None:
        """Say nothing: the terminal belongs to the command."""
