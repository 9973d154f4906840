"""A network of tnet.py or tnets.py in TSNet; prints JSON. Run by them in a venv of its own."""

import contextlib
import importlib.metadata
import json
import sys
import tempfile
import time
import warnings
from pathlib import Path

warnings.filterwarnings("ignore")
import tsnet  # noqa: E402

case = json.load(sys.stdin)
with contextlib.redirect_stdout(sys.stderr), tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "net.inp"
    path.write_text(case["inp"])
    model = tsnet.network.TransientModel(str(path))
    model.set_wavespeed(case["wave_speed_m_s"])
    model.set_time(case["duration_s"], case.get("dt_s"))
    # What happens, in TSNet's words; "step" stands for its time step.
    method, name, *rule = case["event"]
    with_step = lambda value: model.time_step if value == "step" else value
    getattr(model, method)(name, *([with_step(v) for v in r] if isinstance(r, list) else r for r in rule))
    model = tsnet.simulation.Initializer(model, 0.0, case["engine"])
    start = time.perf_counter()
    model = tsnet.simulation.MOCSimulator(model, str(Path(folder) / "results"), "steady")
    seconds = time.perf_counter() - start
    answer = {
        "version": importlib.metadata.version("tsnet"),
        "seconds": seconds,
        "dt_s": float(model.time_step),
        # As TSNet computes with them: the wave speed that fits its step, and Darcy's factor of the steady flow.
        "pipes": {
            name: {
                "ends": [pipe.start_node_name, pipe.end_node_name],
                "wave_speed_m_s": float(pipe.wavev),
                "friction_factor": float(pipe.roughness),
                "velocity_m_s": float(pipe.start_node_velocity[0]),
                "end_head_m": float(pipe.end_node_head[0]),
                "area_m2": float(pipe.area),
            }
            for name, pipe in model.pipes()
        },
        # Demands as flow at a head of 1 m above the node: TSNet lets them follow the pressure.
        "demands": {name: float(getattr(node, "demand_coeff", 0.0)) for name, node in model.junctions()},
        # Parabolas a, b, c of head over flow, and the flow before.
        "pumps": {name: [*map(float, pump.curve_coef), float(pump.initial_flow)] for name, pump in model.pumps()},
        "valves": {name: valve.end_node_name for name, valve in model.valves()},
        "heads_m": {name: [float(h) for h in model.get_node(name).head] for name in case["nodes"]},
    }
json.dump(answer, sys.stdout)
