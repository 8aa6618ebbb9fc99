"""3D human skeletons from calibrated multi-view silhouettes.

The names most people need; each room (`jaxskel.hull`, `jaxskel.graph`, ...) has the rest. In the order of the data:

    recording -> outlines, hull -> graph -> matching -> search -> refinement -> poses

`pipeline` runs them in this order.
"""

import lazy_loader

# Names are imported at their first use, from where `__init__.pyi` says: see CONTRIBUTING.md.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
