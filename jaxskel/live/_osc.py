"""Sends poses on by OSC in the VMC convention, for programs with avatars: needs python-osc."""

import socket
from types import TracebackType

import equinox as eqx

from ..body import Skeleton
from ..io.poses import TPose, t_pose_of
from ..poses import Poses
from ._tally import Moment
from ._vmc import BONE_NAMES, bones_of

VMC_PORT = 39539
"""Where the programs that show avatars listen, by the VMC protocol."""
# What `/VMC/Ext/OK` states: a model is loaded, calibrated, in the normal way.
_LOADED, _CALIBRATED, _NORMAL = 1, 3, 0
_NOT_TURNED = (0.0, 0.0, 0.0, 1.0)


class OscSender:
    """Sends a bundle of messages for each frame, and waits for nobody.

    A frame without a pose sends no bones, and says that nothing is tracked.

    Args:
        host: Name or address of the machine.
        port: Its UDP port.

    Raises:
        ImportError: python-osc is not installed.
        ValueError: There is no such host.
    """

    def __init__(self, host: str, port: int):
        try:
            from pythonosc.osc_bundle_builder import IMMEDIATELY, OscBundleBuilder
            from pythonosc.osc_message_builder import OscMessageBuilder
        except ImportError as error:
            raise ImportError('poses are sent by python-osc, which is missing: pip install "jaxskel[live]"') from error
        self._bundle = lambda: OscBundleBuilder(IMMEDIATELY)
        self._message = OscMessageBuilder
        try:
            # Once, because a name server must not be asked for each frame.
            self._address = socket.getaddrinfo(host, port, socket.AF_INET, socket.SOCK_DGRAM)[0][4]
        except OSError as error:
            raise ValueError(f"{host}:{port}: there is no such host ({error.strerror}); give HOST:PORT") from None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._template: tuple[Skeleton, TPose] | None = None
        self.lost = 0
        """Number of frames that the system could not send: the network is down, for instance."""

    def __call__(self, poses: Poses, moment: Moment) -> None:
        """Send one frame."""
        bones = bones_of(poses, None if poses.skeleton is None else self._t_pose_of(poses.skeleton))
        bundle = self._bundle()

        def add(address: str, *values: str | int | float) -> None:
            message = self._message(address)
            for value in values:
                message.add_arg(value)
            bundle.add_content(message.build())  # pyright: ignore[reportArgumentType]  (it takes messages, too)

        add("/VMC/Ext/OK", _LOADED, _CALIBRATED, _NORMAL, int(bones is not None))
        add("/VMC/Ext/T", float(moment.time))
        if bones is not None:
            add("/VMC/Ext/Root/Pos", "root", 0.0, 0.0, 0.0, *_NOT_TURNED)
            for name, position, quaternion in zip(
                BONE_NAMES, bones.positions.tolist(), bones.quaternions.tolist(), strict=True
            ):
                add("/VMC/Ext/Bone/Pos", name, *position, *quaternion)
        try:
            self._socket.sendto(bundle.build().dgram, self._address)
        except OSError:
            self.lost += 1

    def _t_pose_of(self, skeleton: Skeleton) -> TPose:
        # Compared by their dimensions: each frame brings an object of its own.
        if self._template is None or not eqx.tree_equal(self._template[0], skeleton):
            self._template = skeleton, t_pose_of(skeleton)
        return self._template[1]

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()

    def __enter__(self) -> "OscSender":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        self.close()
