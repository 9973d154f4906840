"""A measurement as a campaign of the program: its plan is written, run on all cores, and what its tasks found is read.

PLACE holds the plan and the campaign's folder, PLACE/tasks. A measurement that was cut off goes on where it was."""
import json
import subprocess


def toml(table):
    """Keys and values; JSON writes numbers, texts and lists as TOML does."""
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())


def done(program, place, cases, options=(), may_fail=False, **keys):
    """Each task of the plan, by case: the task, what it found (none where it failed), and the seconds that it took on one core."""
    place.mkdir(parents=True, exist_ok=True)
    plan, tasks = place / "plan.toml", place / "tasks"
    plan.write_text(toml(keys) + "".join("[[case]]\n" + toml(case) for case in cases) + "[options]\n" + toml(dict(options)))
    for words in (["plan", plan, "-o", tasks], ["run", tasks]):
        if subprocess.run([program, "campaign", *words], stdout=subprocess.DEVNULL).returncode != 0:
            raise SystemExit(f"{place}: no campaign {words[0]}")
    failed = [] if may_fail else json.loads(
        subprocess.run([program, "campaign", "status", tasks, "--json"], capture_output=True, text=True).stdout)["failures"]
    if failed:
        raise SystemExit("\n".join(f"{one['what']}: {one['reason']}" for one in failed))
    # behind the last line break is what a runner that was killed has not finished
    lines = [line for file in sorted(tasks.glob("results/*.jsonl")) for line in file.read_text().split("\n")[:-1]]
    found = {one["task"]: (one["answer"], one["seconds"]) for one in map(json.loads, lines)}
    planned = map(json.loads, (tasks / "tasks.jsonl").read_text().splitlines())
    return [(task, *found.get(task["task"], (None, None))) for task in sorted(planned, key=lambda task: task["case"])]
