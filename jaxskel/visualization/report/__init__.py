"""The report: a recording and its poses as one HTML page; and the page of a live session, with the same scene.

In: a recording and its poses. Out: one HTML file that any browser opens offline; or a page and messages for a server.
"""

from ._live_page import LivePage as LivePage
from ._live_page import live_page as live_page
from ._write import LIMIT as LIMIT
from ._write import write_report as write_report
