"""Templates of skeletons: read from TOML, and those that come with the package.

In: a TOML file. Out: a `Skeleton` with its template.
"""

from ._built_in import BUILT_IN as BUILT_IN
from ._built_in import hand as hand
from ._built_in import human_21 as human_21
from ._built_in import quadruped as quadruped
from ._template_file import read_template as read_template
