#!/usr/bin/env python3
"""Reads a problem that `surgescope pest` wrote with pyEMU, and runs it: pip install pyemu

    check_pest.py folder phi [fitted]

surgescope must be on the PATH. Checks that pyEMU loads the control file and finds in template and instruction file what it names; that
the model command gives an objective function of phi, and nearly so from values that pyEMU wrote; and, if the values are fitted, that a Gauss-Newton
step by pyEMU's reading of the problem would lower it by less than a thousandth. Exit code 0 when all agrees, 1 with what does not.
"""

import os
import subprocess
import sys

import numpy
import pyemu

PEST_PARAMETER, PEST_OBSERVATION = 12, 20


class Mismatch(Exception):
    """The problem is not what it says."""


def expect(condition, message):
    if not condition:
        raise Mismatch(message)


def run_model(pst, values, write):
    """What the model shows at values, by the observations' names; unless write, at those that stand in the file."""
    if os.path.exists(pst.output_files[0]):
        os.remove(pst.output_files[0])
    if write:
        pst.parameter_data["parval1"] = values
        pst.write_input_files()
    command = pst.model_command[0].split()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return pyemu.pst_utils.InstructionFile(pst.instruction_files[0], pst=pst).read_output_file(pst.output_files[0]).obsval


def residuals(pst, values, write=True):
    """Weighted residuals: observations, then prior information."""
    observed = pst.observation_data
    shown = run_model(pst, values, write).loc[observed.index]
    expect(numpy.isfinite(shown).all(), "the model shows what is no number")
    own = (observed.obsval - shown) * observed.weight
    known = []
    if pst.prior_information.shape[0]:
        for equation, weight in zip(pst.prior_information.equation, pst.prior_information.weight):
            left, right = equation.split("=")
            factor, name = (part.strip() for part in left.split("*"))
            log = name.startswith("log(")
            value = values[name[4:-1] if log else name]
            known.append((float(right) - float(factor) * (numpy.log10(value) if log else value)) * float(weight))
    return numpy.concatenate([own.values, known])


def relative_fall(pst, start):
    """Of the objective function, that a Gauss-Newton step promises."""
    values, data = pst.parameter_data.parval1.copy(), pst.parameter_data
    columns = []
    for name in pst.adj_par_names:
        moved = values.copy()
        kind, step = pst.parameter_groups.loc[data.loc[name, "pargp"], ["inctyp", "derinc"]]
        moved[name] += float(step) * (values[name] if kind == "relative" else 1.0)
        columns.append((residuals(pst, moved) - start) / float(step))
    jacobian = numpy.array(columns).T
    step = numpy.linalg.lstsq(jacobian, -start, rcond=None)[0]
    after = start + jacobian @ step
    return 1.0 - after @ after / (start @ start)


def main(folder, phi, fitted=False):
    os.chdir(folder)
    pst = pyemu.Pst("problem.pst")
    with open("problem.pst", encoding="ascii") as file:
        sizes = [int(n) for n in file.read().split("\n")[3].split()]
    found = [pst.npar, pst.nobs, len(pst.parameter_groups), pst.nprior]
    expect(found == sizes[:4], f"the control file says {sizes[:4]}, and pyEMU finds {found}")
    expect(sizes[4] >= len(pst.observation_data.obgnme.unique()), "groups of observations that are not announced")
    expect(max(map(len, pst.par_names)) <= PEST_PARAMETER, "a name of a parameter is too long for PEST")
    expect(max(map(len, pst.obs_names)) <= PEST_OBSERVATION, "a name of an observation is too long for PEST")
    template = pyemu.pst_utils.parse_tpl_file(pst.template_files[0])
    expect(sorted(template) == sorted(pst.par_names), "the template has other parameters")
    instructed = pyemu.pst_utils.parse_ins_file(pst.instruction_files[0])
    expect(instructed == pst.obs_names, "the instruction file reads other observations")
    data = pst.parameter_data
    expect((data.parlbnd < data.parubnd).all(), "bounds out of order")
    expect(data.parval1.between(data.parlbnd, data.parubnd).all(), "a value outside its bounds")

    as_it_stands = residuals(pst, data.parval1.copy(), write=False)
    own = float(as_it_stands @ as_it_stands)
    expect(abs(own / float(phi) - 1.0) < 1e-9, f"the objective function is {own}, and surgescope says {phi}")
    # pyEMU writes seven digits of each value.
    start = residuals(pst, data.parval1.copy())
    rewritten = float(start @ start)
    expect(abs(rewritten / own - 1.0) < 1e-4, f"with values that pyEMU wrote the objective function is {rewritten}, not {own}")
    said = f"{folder}: {pst.npar} parameters, {pst.nobs} observations, objective function {own:.6g} as surgescope says"
    if fitted:
        fall = relative_fall(pst, start)
        expect(0.0 <= fall < 1e-3, f"a Gauss-Newton step would lower the objective function by {fall:.2%}")
        said += f", and a Gauss-Newton step would lower it by {fall:.1e} of itself"
    print(said)


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4) or sys.argv[3:] not in ([], ["fitted"]):
        sys.exit(__doc__)
    try:
        main(sys.argv[1], sys.argv[2], len(sys.argv) == 4)
    except Mismatch as mismatch:
        print(f"{sys.argv[1]}: {mismatch}", file=sys.stderr)
        sys.exit(1)
