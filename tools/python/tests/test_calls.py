"""Long calls: Ctrl-C, progress, other threads, memory."""

import gc
import os
import resource
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import surgescope as ss
from conftest import RIGS

TIMES_S = np.linspace(0.0, 2.0, 200)
MANY = {"J1_per_GPa": np.linspace(0.05, 0.2, 20_000)}


@pytest.mark.parametrize(
    "call",
    [
        lambda study: study.diagnose("none"),
        lambda study: study.calibrate(["viscoelastic-wall"], method="global"),
        lambda _: ss.simulate(RIGS / "demo-hdpe.toml", set={"reaches": 20_000}, times_s=[60.0]),
        lambda _: ss.simulate_many(RIGS / "demo-hdpe.toml", ["viscoelastic-wall:1"], MANY, times_s=TIMES_S),
    ],
    ids=["diagnose", "calibrate", "simulate", "simulate_many"],
)
def test_ctrl_c_ends_a_call_at_once_and_leaves_nothing_at_work(study: ss.Study, call: Callable[[ss.Study], object]) -> None:
    pressed = []

    def press() -> None:
        time.sleep(0.7)
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=press).start()
    with pytest.raises(KeyboardInterrupt):
        call(study)
    assert time.monotonic() - pressed[0] < 0.2
    time.sleep(0.3)
    before = time.process_time()
    time.sleep(0.5)
    assert time.process_time() - before < 0.1


@pytest.mark.night
def test_progress_is_told_and_may_end_the_call(study: ss.Study) -> None:
    heard: list[ss.Progress] = []
    study.diagnose("none", most_reaches=32, progress=heard.append)
    assert len(heard) > 2 and all(str(p) for p in heard) and any(p.reaches for p in heard)
    counted: list[ss.Progress] = []
    table = {"J1_per_GPa": np.linspace(0.05, 0.2, 500)}
    ss.simulate_many(RIGS / "demo-hdpe.toml", ["viscoelastic-wall:1"], table, times_s=TIMES_S, progress=counted.append)
    done = [p.done for p in counted if p.done is not None]
    assert done == sorted(done) and all(p.total == 500 for p in counted) and len(done) > 0

    class Enough(Exception):
        pass

    def enough(_: ss.Progress) -> None:
        raise Enough

    with pytest.raises(Enough):
        study.diagnose("none", progress=enough)
    with pytest.raises(ss.Error, match="neither a callable"):
        study.diagnose("none", progress=3)  # type: ignore[arg-type]


def test_a_bar_is_shown_where_it_is_asked_for(study: ss.Study, capfd: pytest.CaptureFixture[str]) -> None:
    study.calibrate(most_reaches=64)
    assert capfd.readouterr() == ("", ""), "nothing is printed unless asked for"
    table = {"J1_per_GPa": np.linspace(0.05, 0.2, 500)}
    ss.simulate_many(RIGS / "demo-hdpe.toml", ["viscoelastic-wall:1"], table, times_s=TIMES_S, progress=True)
    assert "/500" in capfd.readouterr().err


def test_other_threads_go_on(study: ss.Study) -> None:
    ticks, stop = [0], threading.Event()

    def tick() -> None:
        while not stop.is_set():
            ticks[0] += 1
            time.sleep(0.001)

    other = threading.Thread(target=tick)
    other.start()
    began = time.monotonic()
    study.calibrate("viscoelastic-wall", most_reaches=64)
    seconds = time.monotonic() - began
    stop.set()
    other.join()
    assert ticks[0] > 20 * seconds


def test_threads_fit_side_by_side(study: ss.Study) -> None:
    found: list[float] = []
    threads = [threading.Thread(target=lambda: found.append(study.calibrate(most_reaches=32).rmse_m)) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 4 and len(set(found)) == 1


@pytest.mark.night
def test_memory_stays_as_it_is_over_ten_thousand_calls() -> None:
    rig = ss.Rig.load(RIGS / "demo-hdpe.toml")
    times_s = np.linspace(0.0, 0.05, 50)

    def kib() -> int:
        gc.collect()
        status = Path("/proc/self/status")
        if not status.exists():
            return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return int(status.read_text().split("VmRSS:")[1].split()[0])

    def calls(n: int) -> None:
        for _ in range(n):
            ss.simulate(rig, ["leak"], {"reaches": 16}, times_s=times_s)

    calls(2_000)
    before = kib()
    calls(10_000)
    assert kib() - before < 2_048, "less than 2 MiB, 0.2 KiB a call"
