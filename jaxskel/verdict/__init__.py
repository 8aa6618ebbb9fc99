"""Before any pose: do the views of a recording agree, and is what they agree on a person?

In: a `Recording`. Out: a `Verdict` that names what is wrong, its likely cause and the guilty view.
"""

from ._gate import doubts_before_work as doubts_before_work
from ._judge import Finding as Finding
from ._judge import Severity as Severity
from ._judge import Verdict as Verdict
from ._judge import judge as judge
