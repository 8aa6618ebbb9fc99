"""Reconstructs many recordings. A result is either complete or absent, and is not computed twice."""

from ._folders import ResultFolder as ResultFolder
from ._manifest import Manifest as Manifest
from ._manifest import Outcome as Outcome
from ._manifest import read_manifest as read_manifest
from ._method import Method as Method
from ._names import SUMMARY_FILE as SUMMARY_FILE
from ._one import finished_before as finished_before
from ._one import reconstruct_one as reconstruct_one
from ._places import check_places as check_places
from ._run import BatchResult as BatchResult
from ._run import Shard as Shard
from ._run import check_uncoupled as check_uncoupled
from ._run import run_batch as run_batch
from ._sources import Source as Source
from ._sources import find_sources as find_sources
from ._summary import COLUMNS as COLUMNS
from ._summary import check_summary as check_summary
from ._summary import read_results as read_results
from ._summary import summary_row as summary_row
from ._summary import write_summary as write_summary
from ._workers import PROCESS_BYTES as PROCESS_BYTES
from ._workers import TIMEOUT as TIMEOUT
from ._workers import Finished as Finished
from ._workers import Progress as Progress
