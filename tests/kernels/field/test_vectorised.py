"""Losing vectorisation is silent and costs fifteen times: the machine code of block kernels works on whole vectors.

How fast they are is measured by `resfit bench kernels`, beside the machine's peak.
"""

from __future__ import annotations

import platform
import re
from collections import Counter
from collections.abc import Callable

import capstone
import pytest
import warp as wp

from resfit.kernels.field.adjoint_kernels import fold_kernels
from resfit.kernels.field.containment_count import count_kernel
from resfit.kernels.field.evaluate import field_kernels
from resfit.kernels.field.gradient import gradient_kernel
from resfit.kernels.field.jacobian import jacobian_kernel
from resfit.kernels.primitives import FAMILIES
from resfit.kernels.refine.nearest_primitives import find_owners_kernel
from resfit.kernels.refine.normal_equations import normal_equations_kernel
from resfit.kernels.runtime import module_loading
from resfit.kernels.select.containment import mask_kernel

ARITHMETIC = re.compile(r"v?(?:add|sub|mul|div|sqrt|min|max|fn?m(?:add|sub)\d+)(ss|ps)")
"""Instructions of SSE, AVX and AVX-512: on one float (ss) or on as many as a vector holds (ps)."""

LEAST_SHARE = 0.3
"""Vector instructions for each scalar one, at least. A vectorised loop has both: a scalar loop follows for the points
that are left over. The numbers that are derived from a primitive's row before the loop are scalar in any case."""

KERNELS: dict[str, Callable[[str], wp.Kernel | tuple[wp.Kernel, ...]]] = {
    "values and union": field_kernels,
    "gradient": gradient_kernel,
    "holders": count_kernel,
    "inside": mask_kernel,
    "ownership": find_owners_kernel,
    "normal equations": lambda family: normal_equations_kernel(family, 256),
    "union forward and backward": fold_kernels,
}


def instructions(kernel: wp.Kernel, device: wp.Device) -> Counter[str]:
    """How many instructions of a kind the module of a kernel has: ss, ps, and calls into a maths library."""
    if not device.is_cpu or platform.machine().lower() not in ("x86_64", "amd64"):
        pytest.skip("only the code of x86 processors is read here")
    module_loading.load(kernel, device)
    code = module_loading._cached_code(kernel.module, device).read_bytes()
    reader = capstone.Cs(capstone.CS_ARCH_X86, capstone.CS_MODE_64)
    # The file holds headers and constants, too: what is no instruction is passed over.
    reader.skipdata = True
    found: Counter[str] = Counter()
    for _, _, name, operands in reader.disasm_lite(code, 0):
        if match := ARITHMETIC.fullmatch(name):
            found[match[1]] += 1
        # One function for each number of the vector. Those of the memory are called by their place in a table.
        found["calls"] += name == "call" and operands.isalnum() and operands.startswith("r")
    return found


def assert_vectorised(kernel: wp.Kernel, device: wp.Device, calls: bool = False) -> None:
    found = instructions(kernel, device)
    assert found["ps"] > LEAST_SHARE * found["ss"] > 0
    assert (found["calls"] > 0) == calls


@pytest.mark.parametrize("name", KERNELS)
def test_block_kernels_work_on_vectors(name: str, device: wp.Device) -> None:
    made = KERNELS[name]("superfrustum")
    for kernel in made if isinstance(made, tuple) else (made,):
        assert_vectorised(kernel, device)


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_every_family_can_be_vectorised(family: str, device: wp.Device) -> None:
    """One branch in its field would do. Only the superquadric's powers come from a maths library."""
    assert_vectorised(field_kernels(family)[0], device, calls=family == "superquadric")


def test_a_point_a_thread_is_not_vectorised(device: wp.Device) -> None:
    """What the others would come to: the two kinds are told apart."""
    found = instructions(jacobian_kernel("superfrustum"), device)
    assert found["ps"] < 0.5 * LEAST_SHARE * found["ss"]
