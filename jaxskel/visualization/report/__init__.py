"""A recording and its poses as one HTML page, which opens offline in any browser."""

from ._write import LIMIT as LIMIT
from ._write import write_report as write_report
