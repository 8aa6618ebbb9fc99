"""The command line, one file for each command.

In: arguments. Out: files, messages and an exit code. The commands only call public functions of the package.
"""

from ._app import main as main
