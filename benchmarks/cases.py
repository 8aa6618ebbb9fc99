"""Repeats cases that once went wrong, and compares the outcome with what is expected.

    python benchmarks/cases.py CASES [NAME ...]

CASES is a folder of folders, each with the files of a case and a README that says what should happen. Each is copied to
a temporary folder, where the commands of jaxskel in its README are run. Then a line is printed: name, ok or NOT ok,
what was expected, what happened. NAME chooses cases. Exit code 1 if any is not ok; an unknown case is not ok.
"""

import argparse
import sys
import tempfile
from pathlib import Path

from _case import Act, Case, NotAsExpected, Rows, copied
from _case_batches import BATCHES
from _case_commands import COMMANDS
from _case_folders import FOLDERS
from _case_rigs import RIGS

KNOWN: Rows = RIGS | FOLDERS | BATCHES | COMMANDS


def _unknown(case: Case) -> str:
    raise NotAsExpected("unknown case: give it a row in this script")


def tried(root: Path, name: str, act: Act, place: Path) -> tuple[bool, str]:
    """Run a case; return whether it went as expected, and what happened."""
    case = Case(place / name, root)
    copied(root / name, case.path)
    try:
        return True, act(case)
    except NotAsExpected as error:
        return False, str(error)
    except Exception as error:  # after any error, the other cases still run
        return False, f"{type(error).__name__}: {error}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=Path, help="folder of cases")
    parser.add_argument("names", nargs="*", help="only these")
    arguments = parser.parse_args()
    if not arguments.cases.is_dir():
        parser.error(f"{arguments.cases}: give a folder of cases")
    root = arguments.cases.resolve()
    names = sorted(path.name for path in root.iterdir() if path.is_dir())
    lost = sorted(set(arguments.names) - set(names))
    if lost:
        parser.error(f"{', '.join(lost)}: there is no such case in {arguments.cases}")
    chosen = arguments.names or names
    bad = []
    with tempfile.TemporaryDirectory(prefix="cases") as place:
        for name in chosen:
            expected, act = KNOWN.get(name, ("nothing is known of it", _unknown))
            is_right, got = tried(root, name, act, Path(place))
            bad += [] if is_right else [name]
            got = " ".join(got.replace(place, "").split())
            print(f"{name}: {'ok' if is_right else 'NOT ok'}; expected: {expected}; got: {got[:300]}", flush=True)
    print(f"{len(chosen)} cases, {len(chosen) - len(bad)} ok" + (f"; NOT ok: {', '.join(bad)}" if bad else ""))
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
