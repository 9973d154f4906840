"""Other processes: dask, joblib and Ray map over the package as over any function."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
import surgescope as ss
from conftest import RECORDINGS, RIGS

FILE = str(RECORDINGS / "hdpe-creep.mcap")


def fitted(study: ss.Study, effects: str) -> ss.Fit:
    return study.calibrate(effects, most_reaches=16, threads=1)


def simulated(rig: ss.Rig, speed: float) -> float:
    return float(ss.simulate(rig, set={"wave_speed_m_s": speed}, times_s=[0.5])["P1"][0])


@pytest.mark.night
def test_dask_maps_over_studies_fits_and_rigs(study: ss.Study) -> None:
    from dask.distributed import Client, LocalCluster

    models = ["none", "viscoelastic-wall:1"]
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        fits = client.gather(client.map(fitted, [study] * 2, models))
        verdict = client.submit(lambda fit: fit.diagnose(threads=1).verdict, fits[1]).result()
        rig = ss.Rig.load(RIGS / "demo-hdpe.toml")
        heads = client.gather(client.map(simulated, [rig] * 3, [300.0, 350.0, 400.0]))
    here = [fitted(study, model) for model in models]
    assert [fit.rmse_m for fit in fits] == [fit.rmse_m for fit in here]
    assert [p.value for p in fits[1].parameters.values()] == [p.value for p in here[1].parameters.values()]
    assert verdict == here[1].diagnose().verdict
    assert heads == [simulated(rig, speed) for speed in (300.0, 350.0, 400.0)]


def test_joblib_maps_over_studies(study: ss.Study) -> None:
    from joblib import Parallel, delayed

    models = ["none", "viscoelastic-wall:1"]
    fits = Parallel(n_jobs=2)(delayed(fitted)(study, model) for model in models)
    here = [fitted(study, model) for model in models]
    assert [[p.value for p in fit.parameters.values()] for fit in fits] == [[p.value for p in fit.parameters.values()] for fit in here]


def test_ray_maps_over_studies(study: ss.Study) -> None:
    ray = pytest.importorskip("ray")
    models = ["none", "viscoelastic-wall:1"]
    own_folder = {"env_vars": {"PYTHONPATH": str(Path(__file__).parent)}}
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, runtime_env=own_folder)
    try:
        remote = ray.remote(fitted)
        fits = ray.get([remote.remote(study, model) for model in models], timeout=120)
        verdict = ray.get(ray.remote(lambda fit: fit.diagnose(threads=1).verdict).remote(fits[1]), timeout=120)
    finally:
        ray.shutdown()
    here = [fitted(study, model) for model in models]
    assert [[p.value for p in fit.parameters.values()] for fit in fits] == [[p.value for p in fit.parameters.values()] for fit in here]
    assert verdict == here[1].diagnose().verdict


def test_spawned_and_forked_processes_work(study: ss.Study) -> None:
    for method in ("spawn", "fork"):
        with ProcessPoolExecutor(2, mp_context=get_context(method)) as pool:
            fits = list(pool.map(fitted, [study, study], ["none", "none"], timeout=120))
        assert np.allclose([fit.rmse_m for fit in fits], fitted(study, "none").rmse_m, rtol=0, atol=0)
