import gc
import os
import shutil
import signal
import tempfile
import threading
from pathlib import Path

# At LLVM's first level of optimisation, tracing and compiling take a sixth less time than at the second, and programs
# run as fast. JAX reads this when it makes its backend; processes that tests start inherit it.
os.environ.setdefault("XLA_FLAGS", "--xla_backend_optimization_level=1")
# Each core has a process of its own already: threads of NumPy's solvers would wait for each other, busily. This is read
# when NumPy is loaded; the processes that run tests inherit it.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import jax
import pytest
from support.optimisations import optimised

from jaxskel._runtime.compile_cache import CachedJit

# Tracing makes millions of objects that live on, and by default the collector looks through them again and again, for a
# tenth of the suite's time.
gc.set_threshold(100_000, 20, 10)

# A shell that starts a job in the background lets it ignore interrupts, and all that the job starts.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


OWN_FOLDER = pytest.StashKey[str]()


def pytest_configure(config: pytest.Config) -> None:
    """What one process compiles, the others load: the first one makes a folder, and those that it starts inherit it."""
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
        config.stash[OWN_FOLDER] = tempfile.mkdtemp(prefix="jaxskel-tests-")
        # Given a size, JAX locks the folder.
        options = config.stash[OWN_FOLDER], 0.2, 10**10
        names = "COMPILATION_CACHE_DIR", "PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "COMPILATION_CACHE_MAX_SIZE"
        for name, option in zip(names, options, strict=True):
            os.environ[f"JAX_{name}"] = str(option)
            jax.config.update(f"jax_{name.lower()}", option)


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove that folder, and let the process end quickly."""
    # Else the collector looks through all that is left again and again, which took 5 s of each process.
    gc.collect()
    gc.freeze()
    if OWN_FOLDER in config.stash:
        shutil.rmtree(config.stash[OWN_FOLDER], ignore_errors=True)


# Files that take longest: begun last, one of them would keep a single process busy at the end. Those that load what
# `test_pipeline.py` compiles come when it has done so.
LONGEST = (
    "test_real_recordings.py", "test_from_pose2sim.py", "test_pipeline.py", "test_refine.py", "test_robust.py",
    "test_soft_carve.py", "test_placement.py", "test_terms_of_templates.py", "test_slurm.py", "test_stream.py",
    "test_table.py", "test_sequence.py", "test_solve.py", "test_readme.py", "test_cli.py", "test_batch.py",
    "test_own_data.py", "test_track.py", "test_fisheye_pipeline.py", "test_refine_cameras.py", "test_shared.py",
    "test_fuzz.py", "test_calibrate_body.py", "test_found_subject.py", "test_search_objective.py",
    "test_coupled_batches.py", "test_benchmark_scripts.py", "test_run_volumes.py", "test_statuses.py",
    "test_cli_recordings.py", "test_gradients.py", "test_run_objective.py", "test_run_template.py", "test_bundle.py",
    "test_volume.py", "test_learn.py", "test_stored.py", "test_warm_up.py",
)  # fmt: skip


def pytest_addoption(parser: pytest.Parser) -> None:
    """Some of the slow tests: together they take longer than one wants to wait for a change to be tested."""
    parser.addoption(
        "--slow-part", metavar="I/N", default="1/1", help="of the files, the I-th of N parts runs slow tests"
    )


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """The longest files first; the others stay in their order. Slow tests of one part only, if it is given."""
    rank = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.path.name, len(rank)))
    part, parts = (int(number) for number in config.getoption("--slow-part").split("/"))
    slow = [item for item in items if item.get_closest_marker("slow")]
    # Next to each other in this order are files that take about equally long.
    chosen = list(dict.fromkeys(item.path for item in slow))[part - 1 :: parts]
    left_out = {item for item in slow if item.path not in chosen}
    items[:] = [item for item in items if item not in left_out]
    config.hook.pytest_deselected(items=list(left_out))


@pytest.fixture(autouse=True, scope="session")
def no_silent_broadcasting():
    """The classic bug of geometry: a vector meets a stack of vectors, and every shape still fits."""
    jax.config.update("jax_numpy_rank_promotion", "raise")


# Rooms and files whose programs are compiled for longer than they run.
HARDLY_RUN = {
    "_math", "body", "body_calibration", "cameras", "matching", "outlines", "refinement", "test_search_objective.py",
    "test_fisheye_pipeline.py", "test_soft_carve.py", "test_table.py",
}  # fmt: skip
MUCH_RUN = {"test_draw_adult.py"}


@pytest.fixture(autouse=True, scope="module")
def compiled_only_to_run_once(request: pytest.FixtureRequest):
    """Such programs are compiled without optimisations, which would take longer than they save."""
    hardly = bool(HARDLY_RUN & set(request.path.parts)) and request.path.name not in MUCH_RUN
    with optimised(not hardly):
        yield


@pytest.fixture(autouse=True, scope="module")
def nothing_is_compiled_in_the_background_of_other_tests():
    """Programs that were begun ahead may not be needed any more when the tests that began them are over."""
    yield
    for thread in threading.enumerate():
        if thread.name.startswith("ThreadPoolExecutor"):
            thread.join()


# Linux allows a process 65530 mappings. The difference is reserved for the tests of one more file.
MOST_MAPPINGS = 25_000


def mappings() -> int:
    """Number of mappings of this process; the largest allowed number if the system does not report it."""
    try:
        return Path("/proc/self/maps").read_bytes().count(b"\n")
    except OSError:
        return MOST_MAPPINGS


@pytest.fixture(autouse=True, scope="module")
def no_more_programs_than_a_process_may_hold():
    """Every compiled function maps memory pages; with thousands of them, the suite would reach the kernel's limit.

    Below the limit they are kept, so that files can share compiled functions.
    """
    yield
    if mappings() < MOST_MAPPINGS:
        return
    jax.clear_caches()
    for kept in (thing for thing in gc.get_objects() if isinstance(thing, CachedJit)):
        kept.forget()
    gc.collect()  # programs are in cycles
