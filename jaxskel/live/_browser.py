"""Shows poses in a browser on this machine as they come: needs websockets.

The server listens on the loopback interface only. Other sites in the same browser cannot read from it: a page of theirs
has another origin, and one whose name was made to lead here has another host. Both are refused.
"""

import logging
import socket
from contextlib import suppress
from threading import Condition, Thread
from types import TracebackType
from typing import Any

from ..body import Skeleton
from ..poses import Poses
from ..recording import Recording
from ..visualization.report import live_page
from ._tally import Moment

_LOOPBACK = "127.0.0.1"
# Whoever asks for something odd gets an answer, which is no matter for the terminal.
_SILENT = logging.Logger(__name__, logging.CRITICAL + 1)
_MOST_BYTES = 1000  # of a message from a browser, which has nothing to say
_TO_END = 1.0  # s in which a browser may say that it is gone
_LOOK_UP = 0.5  # s, after which a browser that waits for a frame is looked after


class PoseServer:
    """Serves a page, and to each browser that shows it the newest pose. A slow browser misses some.

    Args:
        rig: Cameras, up axis and name of the session.
        port: Port to listen on; 0 for any free one.
        skeleton: Of the template of the session's poses; None for the paper's human.

    Raises:
        ImportError: websockets is not installed.
        ValueError: The port is taken.
    """

    def __init__(self, rig: Recording, port: int = 0, skeleton: Skeleton | None = None):
        try:
            from websockets.exceptions import ConnectionClosed
            from websockets.sync.server import serve
        except ImportError as error:
            raise ImportError(
                'the page is served by websockets, which is missing: pip install "jaxskel[live]"'
            ) from error
        self._closed_by_browser = ConnectionClosed
        self._changed = Condition()
        self._message, self._count, self._ended = "", 0, False
        self._browsers: set[Any] = set()
        try:
            self._server = serve(
                self._send_on, _LOOPBACK, port, process_request=self._answer, compression=None, max_size=_MOST_BYTES,
                close_timeout=_TO_END, logger=_SILENT,
            )  # fmt: skip
        except OSError as error:
            raise ValueError(f"port {port}: cannot be listened on ({error.strerror}); give another one") from None
        port = self._server.socket.getsockname()[1]
        self._hosts = tuple(f"{name}:{port}" for name in (_LOOPBACK, "localhost"))
        self.address = f"http://{self._hosts[0]}/"
        """Where the page is."""
        self._page = live_page(rig, skeleton, self._hosts)
        self._thread = Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def __call__(self, poses: Poses, moment: Moment) -> None:
        """Show one frame, if there is a browser."""
        if not self._browsers:
            return
        message = self._page.message(poses, str(moment))
        with self._changed:
            self._message, self._count = message, self._count + 1
            self._changed.notify_all()

    def close(self) -> None:
        """End all connections."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
            self._changed.wait_for(lambda: not self._browsers, _TO_END)
            for connection in self._browsers:  # of browsers that do not even read
                with suppress(OSError):
                    connection.socket.shutdown(socket.SHUT_RDWR)
        self._server.shutdown()
        self._thread.join()

    def __enter__(self) -> "PoseServer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()

    def _answer(self, connection: Any, request: Any) -> Any:
        """The response to a request; None lets a browser that shows the page have the poses."""
        origins = [f"http://{host}" for host in self._hosts]
        if request.headers.get_all("Host") not in [[host] for host in self._hosts]:
            return connection.respond(403, "This page is for browsers on this machine only.\n")
        if any(origin not in origins for origin in request.headers.get_all("Origin")):
            return connection.respond(403, "The poses are for this machine's own page only.\n")
        if request.path == "/poses":
            return None
        if request.path != "/":
            return connection.respond(404, "There is nothing here.\n")
        response = connection.respond(200, self._page.html)
        del response.headers["Content-Type"]
        response.headers.update({"Content-Type": "text/html; charset=utf-8", "Cache-Control": "no-store"})
        return response

    def _send_on(self, connection: Any) -> None:
        """Send each frame, or the newest one where a browser is too slow for all, until either side ends."""
        with self._changed:
            self._browsers.add(connection)
            sent = self._count
        try:
            while not self._ended:
                with self._changed:
                    if self._count == sent:
                        self._changed.wait(_LOOK_UP)
                    message, new, sent = self._message, self._count > sent, self._count
                if new:
                    connection.send(message)
                else:
                    connection.ping()  # fails if the browser is gone
        except (self._closed_by_browser, OSError):
            pass
        finally:
            with self._changed:
                self._browsers.discard(connection)
                self._changed.notify_all()
