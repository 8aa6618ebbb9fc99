"""A program with an avatar, which poses are sent to."""

import threading

from pythonosc.dispatcher import Dispatcher
from pythonosc.osc_server import BlockingOSCUDPServer


class Avatar:
    """It keeps all messages that it gets."""

    def __init__(self):
        self.messages: list[tuple] = []
        dispatcher = Dispatcher()
        dispatcher.set_default_handler(lambda address, *values: self.messages.append((address, *values)))
        self.server = BlockingOSCUDPServer(("127.0.0.1", 0), dispatcher)
        self.port = self.server.server_address[1]
        self.thread = threading.Thread(target=self.server.serve_forever, kwargs={"poll_interval": 0.01})
        self.thread.start()

    def of(self, address: str) -> list[tuple]:
        return [values for name, *values in self.messages if name == address]

    def wait(self, times: int) -> None:
        for _ in range(1000):
            if len(self.of("/VMC/Ext/T")) >= times:
                break
            threading.Event().wait(0.01)
        # Messages of a bundle come together.
        threading.Event().wait(0.05)

    def close(self) -> None:
        self.server.shutdown()
        self.thread.join()
        self.server.server_close()
