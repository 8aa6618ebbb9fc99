"""Benchmark scripts, run as from the command line."""

import subprocess
import sys
from pathlib import Path

import accuracy

BENCHMARKS = Path(accuracy.__file__).parent


def benchmark(name: str, *arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    command = [sys.executable, str(BENCHMARKS / name), *map(str, arguments)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=300)
