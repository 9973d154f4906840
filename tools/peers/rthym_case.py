"""The case of compare.py in rthym-moc; prints JSON. Run by compare.py in a venv of its own."""

import json
import sys
import time

import numpy
import rthym_moc


def run(case: dict, steps: int) -> tuple[float, numpy.ndarray]:
    """Seconds of the solve and heads at the valve, m."""
    solver = rthym_moc.MOCSolver()
    solver.add_node(rthym_moc.node_si("R", "PressureBoundary", head_m=case["supply_head_m"]))
    solver.add_node(
        rthym_moc.node_si("V", "Junction", head_m=case["valve_head_m"], demand_m3s=case["flow_m3_s"])
    )
    solver.add_pipe(
        rthym_moc.pipe_si(
            "P",
            "R",
            "V",
            length_m=case["length_m"],
            diameter_mm=case["diameter_m"] * 1e3,
            roughness=case["hazen_williams"],
            flow_m3s=case["flow_m3_s"],
        )
    )
    dt = case["dt_s"]
    closing = [(0.0, case["flow_m3_s"]), (case["closing_steps"] * dt, 0.0)]
    rthym_moc.set_demand_schedule_si(solver, "V", closing)
    start = time.perf_counter()
    # Steady friction only: k_bru = 0, and a filter of one step.
    results = solver.run(total_time=(steps - 0.5) * dt, dt=dt, usf_tau=dt, k_bru=0.0)
    seconds = time.perf_counter() - start
    heads = numpy.asarray(results["node_head"]["V"]) * 0.3048
    assert abs(len(heads) - steps) <= 1, f"{len(heads)} values for {steps} steps"
    return seconds, heads


case = json.load(sys.stdin)
answer = {"version": rthym_moc.__version__, "seconds": run(case, case["steps"]["rthym-moc"])[0]}
if case["with_peak"]:
    _, heads = run(case, case["peak_steps"])
    answer |= {"first_head_m": float(heads[0]), "peak_m": float(heads.max())}
json.dump(answer, sys.stdout)
