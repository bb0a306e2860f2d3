"""Modules load without the garbage collector, and those of a fit no earlier than they are needed."""

from __future__ import annotations

import gc
import subprocess
import sys

import pytest

from resfit import loading

LATER = [
    "trimesh",
    "scipy",
    "pydantic",
    "networkx",
    "resfit.fitter.search.multi_start",
    "resfit.result.fit_result",
]
"""What the kernels and the mesh's reading do not wait for."""


def run(code: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_facade_loads_before_what_a_fit_needs_later() -> None:
    assert run(f"import sys, resfit.api; print(*set(sys.modules) & set({LATER!r}))") == ""


def test_a_target_is_measured_without_reading_formats() -> None:
    code = "import sys, resfit.shape.target; print(*set(sys.modules) & {'trimesh', 'scipy.spatial', 'scipy.ndimage'})"
    assert run(code) == ""


@pytest.mark.parametrize("enabled", [True, False])
def test_collector_rests_and_goes_on(enabled: bool) -> None:
    (gc.enable if enabled else gc.disable)()
    try:
        with pytest.raises(ImportError), loading.without_collector():
            assert not gc.isenabled()
            raise ImportError
        assert gc.isenabled() == enabled
    finally:
        gc.enable()


def test_only_a_command_leaves_objects_out() -> None:
    code = (
        "import gc; from resfit import loading; {}\n"
        "with loading.without_collector(): pass\n"
        "print(gc.get_freeze_count() > 0)"
    )
    assert run(code.format("pass")) == "False"
    assert run(code.format("loading.own_process()")) == "True"


def test_loads_behind_and_keeps_quiet_about_errors() -> None:
    code = "from resfit.loading import load_behind; load_behind('no_such_module'); load_behind('wave')\n"
    code += "import threading\nfor t in threading.enumerate()[1:]: t.join()\nimport sys; print('wave' in sys.modules)"
    assert run(code) == "True"
