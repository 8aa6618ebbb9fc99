"""Files: recordings and subjects in, poses out."""

from .poses import read_poses as read_poses
from .poses import read_truth as read_truth
from .poses import write_poses as write_poses
from .recordings import read_recording as read_recording
from .recordings import write_recording as write_recording
from .subject import read_body as read_body
from .subject import read_subject as read_subject
from .subject import write_subject as write_subject
