"""Fits by HyperQueue on this machine: two workers, one killed in the middle; the table is that of a serial run, byte for byte.

    python tools/campaign/on_hyperqueue.py PROGRAM      60 fits by the library (pip install hyperqueue)
    python tools/campaign/on_hyperqueue.py PROGRAM HQ   200 fits with the program `hq`: the job that `campaign submit --to hq --go` writes and starts

The wheel holds HyperQueue's server and worker and no `hq` program. A worker lives in the process of its server, so each of the two has a process of its own,
with its own server. Both are given all shards, for runners share a campaign's folder, and the one that is left finishes the work of the other. With `hq`, two
workers have one server, which gives the killed one's shards to the other.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SHARDS = 20
LIMIT_S = 600


def work(program, folder, server, first):
    """One server with a worker of one core, from the shard `first` on."""
    from hyperqueue import Job, LocalCluster
    from hyperqueue.cluster import WorkerConfig

    with LocalCluster(server, WorkerConfig(cores=1)) as cluster:
        client, job = cluster.client(), Job(default_workdir=server)
        for number in range(SHARDS):
            shard = (int(first) + number) % SHARDS + 1
            job.program([program, "campaign", "run", folder, "--shard", f"{shard}/{SHARDS}", "--threads", "1"])
        client.wait_for_jobs([client.submit(job)])


def library_workers(program, place):
    """Two workers by the library, each with its server and the whole job."""
    for number in range(2):
        server = place / f"server-{number}"
        server.mkdir()
        words = ["work", program, place / "array", server, number * SHARDS // 2]
        yield subprocess.Popen([sys.executable, __file__, *map(str, words)])


def hq_workers(hq, program, place):
    """Two workers of one server by the program `hq`, and the server; the job is submitted as a user does."""
    os.environ["HQ_SERVER_DIR"] = str(place / "server")
    os.environ["PATH"] = f"{Path(hq).resolve().parent}:{os.environ['PATH']}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    server = subprocess.Popen([hq, "server", "start"], **quiet)
    ready = time.monotonic() + LIMIT_S
    while subprocess.run([hq, "server", "info"], **quiet).returncode != 0:
        assert time.monotonic() < ready and server.poll() is None, "hq's server does not start"
        time.sleep(0.1)
    for _ in range(2):
        yield subprocess.Popen([hq, "worker", "start", "--cpus", "1"], **quiet)
    subprocess.run([program, "campaign", "submit", place / "array", "--to", "hq", "--go"], check=True)
    yield server


def main(program, hq=None):
    program = str(Path(program).resolve())
    tasks = 200 if hq else 60
    recording = Path(__file__).resolve().parents[2] / "recordings/copper-leak.mcap"
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        (place / "plan.toml").write_text(
            f'kind = "calibrate"\nrecordings = ["{recording}"]\neffects = [["none"], ["unsteady-friction"]]\n'
            f"starts = {tasks // 2}\n[options]\nmost_reaches = 16\nrandom_starts = 1\n"
        )

        def surgescope(*arguments):
            return subprocess.run([program, *map(str, arguments)], check=True, capture_output=True, text=True).stdout

        def done():
            said = subprocess.run([program, "campaign", "status", place / "array", "--json"], capture_output=True, text=True)
            return json.loads(said.stdout)["done"]

        for name in ("serial", "array"):
            planned = json.loads(surgescope("campaign", "plan", place / "plan.toml", "-o", place / name, "--json"))
            assert planned["tasks"] == tasks, planned
        began = time.monotonic()
        surgescope("campaign", "run", place / "serial", "--threads", "1")
        serial_s = time.monotonic() - began

        began = time.monotonic()
        workers = []
        try:
            workers.extend(hq_workers(hq, program, place) if hq else library_workers(program, place))
            while (finished := done()) < tasks // 4:
                assert time.monotonic() - began < LIMIT_S, f"only {finished} tasks done"
                time.sleep(0.1)
            assert workers[1].poll() is None and finished < tasks, "all was done before a worker could be killed"
            workers[1].send_signal(signal.SIGKILL)
            print(f"one of two workers killed with {finished} of {tasks} tasks done")
            if not hq:
                assert workers[0].wait(LIMIT_S) == 0, "the other worker's job failed"
            while done() < tasks:  # a runner of the killed worker may be at its last task
                assert time.monotonic() - began < LIMIT_S, f"{done()} of {tasks} tasks done"
                time.sleep(0.1)
            array_s = time.monotonic() - began
        finally:
            for worker in workers:
                worker.kill()
                worker.wait()
        for name in ("serial", "array"):
            surgescope("results", place / name, "-o", place / f"{name}.csv")
        tables = [(place / f"{name}.csv").read_bytes() for name in ("serial", "array")]
        assert tables[0].count(b"\n") == tasks + 1
        assert tables[0] == tables[1], "the tables differ"
        print(f"HyperQueue's table is the serial one, byte for byte; serial {serial_s:.1f} s, on the workers {array_s:.1f} s")


if __name__ == "__main__":
    if sys.argv[1] == "work":
        work(*sys.argv[2:])
    else:
        main(*sys.argv[1:])
