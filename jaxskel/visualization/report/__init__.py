"""The report: a recording and its poses as one HTML page.

In: a recording and its poses. Out: one HTML file that any browser opens offline.
"""

from ._write import LIMIT as LIMIT
from ._write import write_report as write_report
