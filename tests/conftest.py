"""What every test stands on: the same examples each time, Ctrl-C heard, nothing left running."""

import contextlib
import os
import secrets
import shutil
import signal
import sys

import psutil
import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

# NumPy is not loaded yet. Threads of BLAS that wait for one another, on cores that other tests use,
# take twenty times as long over small matrices.
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

# Languages and terminals decide how things are shown: here those of whoever runs the tests do not.
for _name in ("LC_ALL", "LANG", "TERM", "COLUMNS", "LINES", "NO_COLOR", "FORCE_COLOR"):
    os.environ.pop(_name, None)
os.environ["no_proxy"] = "127.0.0.1"  # servers of tests are asked themselves

# A shell starts what runs in the background with Ctrl-C ignored, and children inherit that. Tests
# send Ctrl-C to their children, whoever started the tests.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# How long an example takes says something of the machine, nothing of the code.
settings.register_profile(
    "suite", derandomize=True, deadline=None, database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)  # fmt: skip
settings.register_profile(
    "torture", settings.get_profile("suite"), derandomize=False, print_blob=True
)
if os.environ.get("FPID_TORTURE") == "full":
    settings.load_profile("torture")
else:
    settings.load_profile("suite")
    # Hypothesis also tries constants of whatever modules of ours are loaded, which differ with the
    # tests that ran before. There is no setting for it; tests/test_suite.py checks that this works.
    providers.is_local_module_file = lambda path: False

#: A variable that all children have, and theirs: which run of tests they belong to.
OWNER, RUN = "FPID_PIN_TESTS", secrets.token_hex()

FLAGS = [
    "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--enable-unsafe-swiftshader",
    # Frames run in their page's process: one of its own was once not there after two minutes.
    "--disable-site-isolation-trials",
]  # fmt: skip


def still_running():
    """Return the processes that these tests have started, each with the test that did."""
    children = set(psutil.Process().children(recursive=True))
    found = {}
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            variables = process.environ()
            ours = process in children or variables.get(OWNER) == RUN
            # Python's own helper of worker processes ends with this process.
            helper = "multiprocessing.resource_tracker" in " ".join(process.cmdline())
            if ours and not helper and process.status() != psutil.STATUS_ZOMBIE:
                found[process] = variables.get("PYTEST_CURRENT_TEST", "a test")
    return found


@pytest.fixture(autouse=True)
def own_code_is_forgotten():
    """Forget a user's own code that a test has run: ledgers name all that a process has."""
    yield
    for name in [name for name in sys.modules if name.startswith("fpid_pin_own_")]:
        del sys.modules[name]


@pytest.fixture(scope="session", autouse=True)
def nothing_is_left_running():
    """Fail at the end, by name, for processes that tests have left; they are killed."""
    os.environ[OWNER] = RUN
    yield
    psutil.wait_procs(still_running(), timeout=10.0)
    left = [
        f"{' '.join(process.cmdline())[:200]} (started by {test})"
        for process, test in still_running().items()
    ]
    for process in still_running():
        process.kill()
    assert left == []


@pytest.fixture(scope="session")
def browser():
    """Return Debian's chromium, driven by playwright; skip where there is none."""
    path = shutil.which("chromium") or shutil.which("chromium-browser")
    if path is None:
        pytest.skip("no chromium here (apt-get install chromium)")
    api = pytest.importorskip("playwright.sync_api", reason="playwright drives the browser")
    with api.sync_playwright() as driver:
        chromium = driver.chromium.launch(executable_path=path, args=FLAGS, timeout=120_000)
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def visit(browser):
    """Return what opens a page for the length of a block.

    At its end nothing may have gone wrong in it (unless `sound` is false), and it must have asked
    for nothing but itself. Pages are small: software draws them.
    """
    from bounded import PATIENCE, until  # a copy of this file stands alone in test_suite.py

    @contextlib.contextmanager
    def visit(
        address, ready="window.fpidPin !== undefined", size=(420, 300), sound=True, **options
    ):  # fmt: skip
        page = browser.new_page(viewport={"width": size[0], "height": size[1]}, **options)
        page.set_default_timeout(1e3 * PATIENCE)
        asked, errors = [], []
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on("console", lambda said: errors.extend([said.text] * (said.type == "error")))
        try:
            page.goto(address)
            until(page, ready)
            yield page
        finally:
            page.close()
        assert errors == [] or not sound
        own = (address.partition("#")[0], "blob:", "data:")
        assert [url for url in asked if not url.startswith(own)] == []

    return visit
