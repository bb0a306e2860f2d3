"""Compiling or loading in the background what a fit will need, while its mesh is still being read.

Compilation lets go of the interpreter lock, so that several modules are compiled side by side; from the cache each
takes milliseconds. Whoever needs a module that is still being compiled waits for that one alone.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

import warp as wp

from .field import culling
from .field.culling import bound_kernel
from .field.field import field_kernels
from .field.gradient import gradient_kernel
from .field.holders import count_kernel
from .field.primitive_set import derive_kernel
from .grid import cell_list, cells, distance_grid, morphology
from .mesh import mesh_grid, mesh_probe, mesh_query, mesh_sign
from .refine import loss_points, loss_rows, ownership, steps
from .refine.idle import drop_idle_kernel
from .refine.normal_equations import add_systems_kernel, kernel_on
from .refine.ownership import find_owners_kernel
from .render import field_scene, march, mesh_scene, raytrace, shading, wavefront
from .runtime.cores import core_count
from .runtime.launch import serial_device
from .runtime.module_loading import load_module
from .select import blends, choice, inside, occupancy, replacement
from .select.inside import mask_kernel

Loads = list[tuple[Callable[[], wp.Module], wp.Device]]


def modules_of_fit(family: str, device: wp.Device) -> Loads:
    """What gives the modules that a fit of one family uses, and where each runs.

    The longest to compile come first, then in order of use.
    """
    reading = [mesh_sign, mesh_query, mesh_probe, mesh_grid, cell_list, distance_grid]
    finding = [cells, morphology]
    choosing = [occupancy, choice, replacement, blends]
    fitting = [
        steps,
        culling,
        ownership,
        loss_points,
        loss_rows,
    ]
    showing = [shading, mesh_scene, field_scene, march, wavefront, raytrace]

    def named(modules: list, where: wp.Device = device) -> Loads:
        return [(lambda module=module: wp.get_module(module.__name__), where) for module in modules]

    def made(*kernels: Callable[[], wp.Kernel]) -> Loads:
        return [(lambda kernel=kernel: kernel().module, device) for kernel in kernels]

    return [
        *made(lambda: kernel_on(device, family)),
        *named(reading),
        *named(finding, serial_device()),
        *made(lambda: derive_kernel(family), lambda: add_systems_kernel),
        *named([inside]),
        *named(choosing, serial_device()),
        *named(fitting),
        *made(
            lambda: field_kernels(family)[0],
            lambda: bound_kernel(family),
            lambda: mask_kernel(family),
            lambda: find_owners_kernel(family),
            lambda: drop_idle_kernel(family),
            lambda: gradient_kernel(family),
            lambda: count_kernel(family),
        ),
        *named(showing),
    ]


def prefetch(family: str, device: wp.Device) -> None:
    """Begin to load what a fit of one family needs, on as many threads as there are cores, and return at once."""
    todo = modules_of_fit(family, device)
    lock = threading.Lock()

    def work() -> None:
        while True:
            with lock:
                if not todo:
                    return
                module, where = todo.pop(0)
            try:
                load_module(module(), where)
            except Exception:  # Whoever needs it will meet the same error, and say so.
                return

    for _ in range(min(core_count(), len(todo))):
        threading.Thread(target=work, name="resfit-prefetch", daemon=True).start()
