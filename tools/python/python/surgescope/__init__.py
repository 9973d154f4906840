"""Record, model and calibrate water-hammer tests, and find the physics that a model lacks.

    import surgescope as ss

    fit = ss.Study("run.mcap").calibrate(["viscoelastic-wall"])
    print(fit.rmse_m, fit.noise_m, fit.parameters["J1_per_GPa"])

Times are in s, heads in m of the fluid column, parameters in the units of their names. Every error is an `Error` with the sentence that the
program `surgescope` prints.
"""

from importlib.metadata import version as _version

from surgescope._native import (
    Candidate,
    Diagnosis,
    Error,
    Fit,
    FittedRun,
    FittedSensor,
    Parameter,
    Pipe,
    Posterior,
    Progress,
    Recording,
    Rig,
    RigSensor,
    Sensor,
    Study,
    SurgescopeWarning,
    defaults,
    read,
    simulate,
    simulate_many,
)
from surgescope._parameters import Parameters, UnknownParameter

__version__ = _version("surgescope")

__all__ = [
    "Candidate",
    "Diagnosis",
    "Error",
    "Fit",
    "FittedRun",
    "FittedSensor",
    "Parameter",
    "Parameters",
    "Pipe",
    "Posterior",
    "Progress",
    "Recording",
    "Rig",
    "RigSensor",
    "Sensor",
    "Study",
    "UnknownParameter",
    "SurgescopeWarning",
    "defaults",
    "read",
    "simulate",
    "simulate_many",
]
