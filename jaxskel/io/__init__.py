"""File formats, one subpackage each kind of data.

In: recordings (calibration, images, masks), subjects, keypoints, motion capture. Out: validated types, and files with
poses in the formats of other tools.
"""

import lazy_loader

# Names are imported at their first use, from where `__init__.pyi` says: see CONTRIBUTING.md.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
