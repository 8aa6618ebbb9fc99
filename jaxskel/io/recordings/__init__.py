"""Recordings: the input of the whole pipeline.

In: a folder with a `recording.toml`, or one sequence file that holds everything. Out: a `Recording` (cameras,
silhouettes, frame rate, up axis), read lazily. A `recording.toml` may name running cameras instead: a `Rig`. Voxels and
meshes are read as `Volumes`, or as a recording of virtual cameras around them.
"""

from ._changed_images import missing_sizes as missing_sizes
from ._changed_images import read_change as read_change
from ._data import read_data as read_data
from ._folders import RECORDING_FILE as RECORDING_FILE
from ._folders import SUBJECT_FILE as SUBJECT_FILE
from ._folders import described_recording as described_recording
from ._folders import described_span as described_span
from ._folders import described_views as described_views
from ._inputs import input_paths as input_paths
from ._people import holds_people as holds_people
from ._people import names_of_people as names_of_people
from ._people import read_people as read_people
from ._recordings import read_recording as read_recording
from ._rig import Rig as Rig
from ._rig import has_cameras as has_cameras
from ._rig import read_rig as read_rig
from ._sequence_file import IN_MEMORY as IN_MEMORY
from ._sequence_file import frame_numbers as frame_numbers
from ._sequence_file import frame_rate as frame_rate
from ._sequence_file import people_in_file as people_in_file
from ._sequence_file import skeleton_of as skeleton_of
from ._sequence_file import truth as truth
from ._sequence_file import write_people as write_people
from ._sequence_file import write_recording as write_recording
from ._sequence_files import holds_silhouettes as holds_silhouettes
from ._sequence_files import sequence_files as sequence_files
from ._template import TEMPLATE_KEYS as TEMPLATE_KEYS
from ._template import check_names as check_names
from ._template import template_arrays as template_arrays
from ._template import template_of as template_of
from ._view_table import open_frames as open_frames
from ._volumes import holds_volumes as holds_volumes
from ._volumes import read_volumes as read_volumes
