"""Calibrated cameras: pinhole with OpenCV's distortion or fisheye lenses (Sect. 3).

In: K, R, t, distortion. Out: projections (px), unit viewing rays, comparisons of rigs.
"""

from ._blind import nameless as nameless
from ._blind import rig_size as rig_size
from ._blind import with_blind_cameras as with_blind_cameras
from ._cameras import Cameras as Cameras
from ._cameras import apparent_depth as apparent_depth
from ._cameras import in_cameras as in_cameras
from ._cameras import lens_slopes as lens_slopes
from ._cameras import make_cameras as make_cameras
from ._cameras import on_images as on_images
from ._cameras import project as project
from ._cameras import rays as rays
from ._cameras import rays_in_camera as rays_in_camera
from ._compare import RigDifference as RigDifference
from ._compare import compare_rigs as compare_rigs
from ._extrinsics import ExtrinsicChange as ExtrinsicChange
from ._extrinsics import changed as changed
from ._extrinsics import no_change as no_change
from ._extrinsics import optical_centres as optical_centres
from ._image_change import TURNS as TURNS
from ._image_change import ImageChange as ImageChange
from ._image_change import with_images_changed as with_images_changed
from ._lens import COEFFICIENTS as COEFFICIENTS
from ._lens import FISHEYE_COEFFICIENTS as FISHEYE_COEFFICIENTS
from ._upright import upright as upright
