"""Systems without what POSIX has: all is imported and run, what cannot be done is refused by name."""

import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

from filippov.base.errors import UsageError
from filippov.sweep import processes, worker

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = {"filippov": "filippov", "filippov.models": "models", "filippov.analysis": "analysis"}
MODULES = [
    ".".join((package, *path.relative_to(ROOT / folder).with_suffix("").parts)).removesuffix(".__init__")
    for package, folder in FOLDERS.items()
    for path in sorted((ROOT / folder).rglob("*.py"))
]
# As on Windows: no modules of POSIX, no signal masks, users or processes to be asked; os.kill ends a process.
BARE = """
import importlib, os, signal, sys
import subprocess, tempfile
import filelock, matplotlib.pyplot, networkx, numba, numpy, scipy.optimize, sympy
import filippov

def ended(*_):
    raise AssertionError("os.kill(pid, 0) ends the process on Windows")

for name in ("fcntl", "resource", "pwd", "grp", "termios", "tty", "posix", "syslog"):
    sys.modules[name] = None
for module, names in (
    (os, ("getuid", "geteuid", "getgid", "O_NOFOLLOW", "O_CLOEXEC", "sched_getaffinity", "mkfifo", "setsid",
          "killpg", "uname", "umask", "fork", "getpgid", "getppid")),
    (signal, ("pthread_sigmask", "SIGKILL", "SIGHUP", "SIGALRM", "setitimer", "SIGUSR1", "SIGPIPE")),
):
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
os.kill = ended

out, *modules = sys.argv[1:]
for module in modules:
    importlib.import_module(module)

from filippov.app.cli.main import main
assert main(["simulate", "hunting", "--t-span", "0", "1", "-o", f"{out}/one"]) == 0
from concurrent.futures import ThreadPoolExecutor
from filippov import Sweep
from filippov.models import registry

hunting = registry.get("hunting")
sweep = Sweep(filippov.Problem(hunting.build(), hunting.x0, (0, 1)), {"P": [10, 20]}, measure=["end(x)"])
for again in (False, True):
    with ThreadPoolExecutor(1) as threads:
        assert sweep.run(f"{out}/many", executor=threads, resume=again).complete
assert main(["doctor"]) == 0
"""


def test_11_24_all_of_it_runs_without_what_posix_has(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", BARE, str(tmp_path), *MODULES], cwd=ROOT, capture_output=True,
        text=True, timeout=250, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    assert (tmp_path / "many" / "manifest.json").is_file()


def test_11_24_a_limit_that_the_system_does_not_keep_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    worker.check_memory_limit(None)
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setitem(sys.modules, "resource", ModuleType("resource"))
    with pytest.raises(UsageError, match="macOS does not keep"):
        worker.check_memory_limit(10**9)
    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setitem(sys.modules, "resource", None)
    with pytest.raises(UsageError, match="max_memory is 1000000000, but win32 has no limit"):
        worker.check_memory_limit(10**9)


@pytest.mark.parametrize(("allowed", "set_to"), [(-1, 1000), (500, 500), (2000, 1000)])
def test_a_limit_is_never_raised(allowed: int, set_to: int, monkeypatch: pytest.MonkeyPatch) -> None:
    calls = []
    fake = ModuleType("resource")
    vars(fake).update(
        RLIMIT_AS=9, RLIM_INFINITY=-1, getrlimit=lambda which: (allowed, allowed),
        setrlimit=lambda which, both: calls.append((which, both)),
    )  # fmt: skip
    monkeypatch.setitem(sys.modules, "resource", fake)
    worker.limit_memory(1000)
    assert calls == [(9, (set_to, set_to))]


def test_every_signal_has_a_name() -> None:
    assert processes._signal_name(int(signal.SIGTERM)) == "signal SIGTERM"
    for number in range(1, 129):
        assert processes._signal_name(number).startswith("signal ")
