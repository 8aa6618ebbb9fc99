"""Views: one camera's images and the rule that makes silhouettes of them (silhouettes are the input of the paper).

In: folders of images, videos, arrays of masks, or cameras. Out: a `View`, which gives the silhouette of each frame of
the recording, and a `MaskRule`, which says which values of a mask are the person.
"""

from ._camera import Camera as Camera
from ._camera import is_camera as is_camera
from ._cut_out import CutOut as CutOut
from ._cut_out import in_colour as in_colour
from ._frames import Frames as Frames
from ._image_folder import ImageFolder as ImageFolder
from ._image_folder import is_image as is_image
from ._image_folder import unread_suffixes as unread_suffixes
from ._mask_archive import MaskArchive as MaskArchive
from ._mask_rule import MaskRule as MaskRule
from ._mask_rule import Person as Person
from ._mask_rule import person_text as person_text
from ._mask_rule import rule_for as rule_for
from ._mask_rule import rule_of as rule_of
from ._masks import Masks as Masks
from ._masks import Matte as Matte
from ._video import VIDEO_SUFFIXES as VIDEO_SUFFIXES
from ._video import Video as Video
from ._view import View as View
from ._view_silhouettes import ViewSilhouettes as ViewSilhouettes
