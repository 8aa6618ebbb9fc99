"""Small files that claim, or unpack to, very much data are refused before memory is allocated."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.archive_bombs import BOMBS
from support.readers import READERS

resource = pytest.importorskip("resource", reason="there is no peak of memory to ask for on this system")
# Memory allowed for reading (MB), in addition to that of the process before: enough for the largest text accepted.
MOST = 300


def read_all(paths: dict[str, str]) -> None:
    """Read each file; print the message, and the peak memory (MB) since the start."""
    told, start = {}, _peak()
    for name, path in paths.items():
        try:
            READERS[BOMBS[name][0]].read(Path(path))
            message = "not refused"
        except ValueError as error:
            message = str(error)
        except Exception as error:
            message = repr(error)
        told[name] = message, _peak() - start
    print(json.dumps(told))


def _peak() -> float:
    """Peak memory of this process (MB); Linux reports kB, other systems bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e3 if sys.platform == "linux" else 1e6)


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, tuple[str, float]]]:
    folder, here, paths = tmp_path_factory.mktemp("bombs"), Path(__file__).parent, {}
    for name, (_, write) in BOMBS.items():
        (folder / name).mkdir()
        paths[name] = str(write(folder / name))
    # In a fresh process, so that its peak memory is that of reading.
    program = "import json, sys; from test_bombs import read_all; read_all(json.loads(sys.argv[1]))"
    search = os.pathsep.join([str(here), str(here.parent), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", program, json.dumps(paths)], env=os.environ | {"PYTHONPATH": search},
        capture_output=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr.decode()[-2000:]
    return folder, json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
@pytest.mark.parametrize("name", BOMBS)
def test_a_small_file_that_claims_much_is_refused_for_little_memory(outcomes, name):
    folder, told = outcomes
    message, megabytes = told[name]
    assert message.startswith(str(folder / name)), message
    assert "\n" not in message
    assert megabytes < MOST
