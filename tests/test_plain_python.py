"""The package without its compiler: plain twins are right, and coverage sees the lines of kernels."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.small_runs import small_variables

# Of the largest value. Sums go in another order and fused multiply-adds round once in kernels, twice in
# Python: measured up to 5e-16 after these short runs, in which little has time to multiply it.
ROUNDING = 1e-14
# Measured 7e-9, of forces in single precision, and 2e-11, in the mean angle of cells with hardly any mass.
MORE = {"q_mono_kinetic paper": 5e-8, "diffusive accurate": 1e-10}


@pytest.mark.plain
@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.heavy)])
def test_kernels_and_plain_python_give_the_same_results(tmp_path: Path, whole: bool) -> None:
    """Every model and scheme with noise, with a fluid or with walls, to rounding; `whole`: with each.

    Must catch a kernel that does not compute what its Python says, and lines that plain Python cannot run.
    """
    file = tmp_path / "plain.npz"
    command = [sys.executable, "-m", "tests.small_runs", str(file), *["whole"][: int(whole)]]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    top = Path(__file__).parents[1]
    subprocess.run(command, cwd=top, env=environment, check=True, timeout=600.0)
    compiled = small_variables(whole=whole)
    with np.load(file) as plain:
        assert set(plain) == set(compiled)
        for name, values in compiled.items():
            rounding = MORE.get(" ".join(name.split()[:2]), ROUNDING)
            bound = rounding * np.abs(values).max()
            np.testing.assert_allclose(plain[name], values, rtol=0.0, atol=bound, err_msg=name)
