"""The page of a session: for this machine's own browsers only, and each shows the newest pose."""

import json
import socket
import sys
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from support.live_sessions import MOMENT, StubStream, numbered, step_of
from support.poses import moving

from jaxskel.live import PoseServer

pytest.importorskip("websockets", reason='needs websockets: pip install "jaxskel[live]"')
from websockets.exceptions import InvalidStatus  # noqa: E402
from websockets.sync.client import connect  # noqa: E402


@pytest.fixture
def server() -> Iterator[PoseServer]:
    with PoseServer(numbered(1)[:0]) as found:
        yield found


def port_of(server: PoseServer) -> int:
    return int(server.address.rstrip("/").rpartition(":")[2])


def asked(server: PoseServer, path: str = "/", **headers: str) -> tuple[int, str]:
    """The status and the body of a plain request."""
    told = {"Host": f"127.0.0.1:{port_of(server)}"} | headers
    lines = [f"GET {path} HTTP/1.1", *(f"{key}: {value}" for key, value in told.items() if value), "", ""]
    with socket.create_connection(("127.0.0.1", port_of(server)), timeout=10) as talk:
        talk.sendall("\r\n".join(lines).encode())
        answer = b""
        while more := talk.recv(1 << 16):
            answer += more
    head, _, body = answer.decode().partition("\r\n\r\n")
    return int(head.split()[1]), body


def listening(server: PoseServer, origin: str | None = None):
    return connect(server.address.replace("http", "ws") + "poses", origin=origin, close_timeout=0.1, max_queue=1)


def shown(server: PoseServer, browser, row: int) -> dict:
    """The message about a frame, which is shown again until the browser has been seen to be there."""
    for _ in range(500):
        server(step_of(moving(5, without=(4,)), row), MOMENT)
        try:
            return json.loads(browser.recv(timeout=0.02))
        except TimeoutError:
            continue
    raise AssertionError("no message")


def test_the_page_is_served_and_loads_nothing(server):
    status, page = asked(server)
    assert status == 200
    assert page.startswith("<!DOCTYPE html>")
    assert "numbered – jaxskel" in page
    assert f"connect-src ws://127.0.0.1:{port_of(server)} ws://localhost:{port_of(server)}" in page
    assert "src=" not in page
    assert "href=" not in page
    assert asked(server, Host=f"localhost:{port_of(server)}")[0] == 200
    assert asked(server, "/other")[0] == 404


@pytest.mark.parametrize("path", ["/", "/poses"])
def test_other_sites_get_nothing(server, path):
    """A name that another site lets lead to this machine, and pages of other sites, are refused."""
    for headers in (
        {"Host": "evil.example"}, {"Host": f"evil.example:{port_of(server)}"}, {"Host": "127.0.0.1:1"}, {"Host": ""},
        {"Origin": "http://evil.example"}, {"Origin": "null"}, {"Origin": f"http://127.0.0.1:{port_of(server) + 1}"},
    ):  # fmt: skip
        status, body = asked(server, path, **headers)
        assert status in (400, 403), headers
        assert "<html" not in body


def test_poses_are_for_the_page_of_this_server(server):
    with pytest.raises(InvalidStatus, match="403"):
        listening(server, "https://evil.example")
    with listening(server, server.address.rstrip("/")) as browser:
        assert shown(server, browser, 1)["number"] == 1


def test_a_message_holds_the_pose(server):
    with listening(server) as browser:
        message = shown(server, browser, 2)
        assert message["told"] == "frame 6, 0.2 s, 24.9 fps, latency 31 ms, 1 dropped"
        assert message["number"] == 2
        assert len(message["points"]) > 100
        shown(server, browser, 4)  # without a pose


class LongMessages:
    """Messages of 100 kB."""

    def message(self, poses, told: str) -> str:
        return json.dumps({"number": int(poses.frame_index[0]), "told": told.ljust(100_000)})


def test_a_slow_browser_misses_poses_and_keeps_nobody_waiting(server, monkeypatch):
    with listening(server) as slow, listening(server) as quick:
        shown(server, slow, 0)
        stream, got, longest = StubStream(None), 0, 0.0
        # More than the buffers between them hold.
        monkeypatch.setattr(server, "_page", LongMessages())
        for number in range(300):
            poses = replace(stream.push(np.zeros(0)), frame_index=np.array([number]))
            start = time.perf_counter()
            server(poses, MOMENT)
            longest = max(longest, time.perf_counter() - start)
            if number % 10 == 9:
                while got < number:
                    got = json.loads(quick.recv(timeout=10))["number"]
        assert got == 299
        assert longest < 1.0
        start = time.perf_counter()
        server.close()
        assert time.perf_counter() - start < 5


def test_a_taken_port_is_named(server):
    with pytest.raises(ValueError, match=f"port {port_of(server)}: cannot be listened on"):
        PoseServer(numbered(1)[:0], port_of(server))


def test_without_its_package_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "websockets.sync.server", None)
    with pytest.raises(ImportError, match=r'pip install "jaxskel\[live\]"'):
        PoseServer(numbered(1)[:0])
