"""200 fits by Slurm on this machine as two nodes: one node killed in the middle; the table is that of a serial run, byte for byte.

    python3 tools/campaign/on_slurm.py PROGRAM      (apt-get install slurm-wlm munge; as root)

It starts daemons of its own, with their files in a temporary folder, and ends them."""

import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# Slurm waits two minutes before it starts the job of a dead node again.
TASKS, SHARDS, LIMIT_S = 200, 20, 300
CONF = """ClusterName=surgescope
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort=26817
AuthInfo=socket={place}/munge.socket
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation={place}/state
SlurmdSpoolDir={place}/spool-%n
SlurmctldPidFile={place}/slurmctld.pid
SlurmdPidFile={place}/slurmd-%n.pid
SlurmctldLogFile={place}/slurmctld.log
SlurmdLogFile={place}/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
MpiDefault=none
ReturnToService=2
SlurmdTimeout=10
NodeName=one NodeHostname={host} NodeAddr=127.0.0.1 Port=26818 CPUs=1 State=UNKNOWN
NodeName=two NodeHostname={host} NodeAddr=127.0.0.1 Port=26819 CPUs=1 State=UNKNOWN
PartitionName=all Nodes=one,two Default=YES MaxTime=INFINITE State=UP
"""


def waits(what, true, limit_s=LIMIT_S):
    began = time.monotonic()
    while not true():
        assert time.monotonic() - began < limit_s, f"no {what} within {limit_s} s"
        time.sleep(0.2)


def run(*words, may_fail=False):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True)
    assert may_fail or done.returncode == 0, f"{words}: {done.stderr}"
    return done.stdout


def end(*kinds):
    """Kills the processes whose command line has all words of a kind."""
    for process in Path("/proc").glob("[0-9]*"):
        try:
            line = (process / "cmdline").read_bytes().decode(errors="replace")
            if any(all(word in line for word in words) for words in kinds):
                os.kill(int(process.name), signal.SIGKILL)
        except (FileNotFoundError, ProcessLookupError):
            pass


def campaign(program, place):
    recording = Path(__file__).resolve().parents[2] / "recordings/copper-leak.mcap"
    (place / "plan.toml").write_text(
        f'kind = "calibrate"\nrecordings = ["{recording}"]\neffects = [["none"], ["unsteady-friction"]]\n'
        f"starts = {TASKS // 2}\n[options]\nmost_reaches = 16\nrandom_starts = 1\n")
    for name in ("serial", "array"):
        run(program, "campaign", "plan", place / "plan.toml", "-o", place / name)
    run(program, "campaign", "run", place / "serial", "--threads", 1)

    def done():
        return json.loads(run(program, "campaign", "status", place / "array", "--json", may_fail=True))["done"]

    return done


def main(program):
    program = str(Path(program).resolve())
    with tempfile.TemporaryDirectory() as place:
        place = Path(place)
        (place / "munge.key").write_bytes(os.urandom(128))
        (place / "munge.key").chmod(0o400)
        (place / "state").mkdir()
        (place / "slurm.conf").write_text(CONF.format(host=socket.gethostname().split(".")[0], place=place))
        os.environ["SLURM_CONF"] = str(place / "slurm.conf")
        done = campaign(program, place)
        munge = ["munged", "--foreground", "--force", f"--socket={place}/munge.socket", f"--key-file={place}/munge.key",
                 f"--pid-file={place}/munge.pid", f"--seed-file={place}/munge.seed", f"--log-file={place}/munge.log"]
        daemons = [subprocess.Popen(munge, stderr=subprocess.DEVNULL)]
        try:
            waits("munge", (place / "munge.socket").exists, 20)
            for words in (["slurmctld", "-D"], ["slurmd", "-D", "-N", "one"], ["slurmd", "-D", "-N", "two"]):
                daemons.append(subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL))
            waits("two idle nodes", lambda: run("sinfo", "-h", "-N", "-t", "idle", may_fail=True).count("all") == 2, 60)
            began = time.monotonic()
            run(program, "campaign", "submit", place / "array", "--to", "slurm", "--shards", SHARDS, "--go")
            waits("quarter of the tasks", lambda: done() >= TASKS // 4)
            before = done()
            assert before < TASKS, "all was done before a node could be killed"
            job = run("squeue", "-h", "-t", "R", "-w", "two", "-o", "%A").split()
            assert job, "no job runs on the second node"
            shard = run("squeue", "-h", "-j", job[0], "-o", "%K").strip()
            # a machine that dies takes all with it: its daemon, what watches its job, the job
            daemons[-1].kill()
            end([f"[{job[0]}."], [str(place / "array"), f"{shard}/{SHARDS}"])
            print(f"one of two nodes killed with {before} of {TASKS} tasks done")
            waits("end of the queue", lambda: done() == TASKS)
            print(f"done {time.monotonic() - began:.1f} s after it was submitted")
        finally:
            for daemon in reversed(daemons):
                daemon.send_signal(signal.SIGTERM if daemon.poll() is None else 0)
                daemon.wait()
        for name in ("serial", "array"):
            run(program, "results", place / name, "-o", place / f"{name}.csv")
        tables = [(place / f"{name}.csv").read_bytes() for name in ("serial", "array")]
        assert tables[0].count(b"\n") == TASKS + 1 and tables[0] == tables[1], "the tables differ"
        print("Slurm's table is the serial one, byte for byte")


main(sys.argv[1])
