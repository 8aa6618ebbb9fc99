"""Plausibility check before any pose is computed: do the views of a recording agree, and do they show a person?

In: a `Recording`. Out: a `Verdict` that names each fault, its likely cause and the views that have it. The paper has
no such step.
"""

from ._gate import doubts_before_work as doubts_before_work
from ._judge import Finding as Finding
from ._judge import Severity as Severity
from ._judge import Verdict as Verdict
from ._judge import judge as judge
