"""What the tests share: the project's rigs and recordings, and its program."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import surgescope as ss

# A shell leaves a job in the background deaf to Ctrl-C; the tests press it.
signal.signal(signal.SIGINT, signal.default_int_handler)

HOME = Path(__file__).resolve().parents[3]
RECORDINGS = HOME / "recordings"
RIGS = HOME / "rigs"

Program = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def program() -> Program:
    """Runs the program: the one that SURGESCOPE names, built from Rust alone, or else the console script."""
    beside = Path(sys.executable).parent / "surgescope"
    path = os.environ.get("SURGESCOPE") or str(beside)

    def run(*arguments: object, cwd: Path | None = None) -> "subprocess.CompletedProcess[str]":
        return subprocess.run([path, *map(str, arguments)], capture_output=True, text=True, cwd=cwd, timeout=300)

    return run


@pytest.fixture(scope="session")
def document(program: Program) -> Callable[..., Any]:
    """The document that a command prints."""

    def run(*arguments: object) -> Any:
        done = program(*arguments, "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    return run


@pytest.fixture(scope="session")
def study() -> ss.Study:
    return ss.Study(RECORDINGS / "hdpe-creep.mcap")


@pytest.fixture(scope="session")
def fit(study: ss.Study) -> ss.Fit:
    """A quick fit of a model that lacks something."""
    return study.calibrate("none", most_reaches=32)


@pytest.fixture(scope="session")
def diagnosis(fit: ss.Fit) -> ss.Diagnosis:
    return fit.diagnose()


@pytest.fixture
def table(tmp_path: Path, program: Program) -> tuple[Path, Path]:
    """A recording as a table, and the file of its rig."""
    csv, rig = tmp_path / "run.csv", tmp_path / "rig.toml"
    done = program("export", RECORDINGS / "hdpe-creep.mcap", "-o", csv)
    assert done.returncode == 0, done.stderr
    rig.write_text(ss.read(RECORDINGS / "hdpe-creep.mcap").rig.source)
    return csv, rig
