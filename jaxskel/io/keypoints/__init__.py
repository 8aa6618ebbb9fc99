"""Keypoints that other tools have found in the images.

In: folders of JSON as OpenPose and Pose2Sim write them, a recording, a `KeypointSet`. Out: an array of image points
(px) without lens distortion and their confidence, NaN where missing, for `jaxskel.refinement.terms.Keypoints`.
"""

from ._folders import read_keypoints as read_keypoints
from ._openpose import parse_people as parse_people
from ._openpose import read_people as read_people
from ._undistort import undistort_keypoints as undistort_keypoints
