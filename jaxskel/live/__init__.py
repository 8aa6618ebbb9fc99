"""Live sessions: a person's skeleton while they move, from cameras or a recording that is played.

In: a source of frames. Out: poses, handed at once to whoever wants them: a journal on disk, a browser, programs that
show avatars.
"""

from ._browser import PoseServer as PoseServer
from ._cameras_here import cameras_here as cameras_here
from ._captures import Captures as Captures
from ._clock import Clock as Clock
from ._clock import WallClock as WallClock
from ._loop import Sink as Sink
from ._loop import play as play
from ._osc import VMC_PORT as VMC_PORT
from ._osc import OscSender as OscSender
from ._playback import Playback as Playback
from ._source import LONGEST as LONGEST
from ._source import PATIENCE as PATIENCE
from ._source import Source as Source
from ._source import Taken as Taken
from ._source import to_drop as to_drop
from ._tally import Moment as Moment
from ._tally import Tally as Tally
from ._vmc import BONE_NAMES as BONE_NAMES
from ._vmc import BONE_PARENTS as BONE_PARENTS
from ._vmc import Bones as Bones
from ._vmc import bones_of as bones_of
from ._vmc import check_avatar as check_avatar
