"""Compiling or loading in the background what a fit will need, while its mesh is still being read.

Compilation lets go of the interpreter lock, so that several modules are compiled side by side; from the cache each
takes milliseconds. Whoever needs a module that is still being compiled waits for that one alone.
"""

from __future__ import annotations

import threading
from collections.abc import Callable

import warp as wp

from .field import culling
from .field.containment_count import count_kernel
from .field.culling import bound_kernel
from .field.evaluate import field_kernels
from .field.gradient import gradient_kernel
from .field.primitive_set import derive_kernel
from .grid import block_list, distance_grid, morphology, sparse_cells
from .mesh import inside_grid, inside_points, mesh_grid, mesh_query
from .refine import levenberg_step, nearest_primitives, residual_points, residual_rows
from .refine.nearest_primitives import find_owners_kernel
from .refine.normal_equations import add_systems_kernel, kernel_on
from .refine.prune_lists import prune_lists_kernel
from .render import mesh_scene, ray_queue, raytrace, sdf_scene, shading, sphere_trace
from .runtime.cores import core_count
from .runtime.launch import serial_device
from .runtime.module_loading import load_module
from .select import blend_search, containment, coverage_gains, coverage_sets, swap_moves
from .select.containment import mask_kernel

Loads = list[tuple[Callable[[], wp.Module], wp.Device]]


def modules_of_fit(family: str, device: wp.Device) -> Loads:
    """Loaders of the modules that a fit of one family uses, and the device of each.

    The longest to compile come first, then in order of use.
    """
    reading = [inside_grid, mesh_query, inside_points, mesh_grid, block_list, distance_grid]
    finding = [sparse_cells, morphology]
    choosing = [coverage_sets, coverage_gains, swap_moves, blend_search]
    fitting = [
        levenberg_step,
        culling,
        nearest_primitives,
        residual_points,
        residual_rows,
    ]
    showing = [shading, mesh_scene, sdf_scene, sphere_trace, ray_queue, raytrace]

    def named(modules: list, where: wp.Device = device) -> Loads:
        return [(lambda module=module: wp.get_module(module.__name__), where) for module in modules]

    def made(*kernels: Callable[[], wp.Kernel]) -> Loads:
        return [(lambda kernel=kernel: kernel().module, device) for kernel in kernels]

    return [
        *made(lambda: kernel_on(device, family)),
        *named(reading),
        *named(finding, serial_device()),
        *made(lambda: derive_kernel(family), lambda: add_systems_kernel),
        *named([containment]),
        *named(choosing, serial_device()),
        *named(fitting),
        *made(
            lambda: field_kernels(family)[0],
            lambda: bound_kernel(family),
            lambda: mask_kernel(family),
            lambda: find_owners_kernel(family),
            lambda: prune_lists_kernel(family),
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
