"""A PyVista plotter as the viewer wants it: light, background, plain text; and meshes ready to be shaded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from .opengl_check import prepare

if TYPE_CHECKING:
    import pyvista as pv

    from ...assembly.surface import Surface

Plotter = Any
"""A `pyvista.Plotter`: its methods are wrapped in a way that type checkers take for missing arguments."""

BACKGROUND_BELOW, BACKGROUND_ABOVE = "#dfe2e7", "#f7f8fa"
INK = "#23272e"
"""Colour of text and lines."""

CREASE = 35.0
"""Degrees between faces from which on an edge is drawn sharp."""

SOFTWARE = ("llvmpipe", "softpipe", "SwiftShader", "swrast")
"""Names of OpenGL without a GPU: smoothing edges takes it several times as long as the picture."""


def make_plotter(size: tuple[int, int], off_screen: bool, title: str = "resfit") -> Plotter:
    """An empty plotter with the viewer's light and background.

    Args:
        size: of the window, pixels.
        off_screen: draw without a window.
        title: of the window.
    """
    prepare(off_screen)
    import pyvista as pv

    _write_text_as_it_is()
    plotter: Plotter = pv.Plotter(off_screen=off_screen, window_size=list(size), lighting="none", title=title)
    plotter.set_background(BACKGROUND_BELOW, top=BACKGROUND_ABOVE)
    for place, strength in (((-0.55, 0.85, 1.0), 0.88), ((0.9, 0.1, 0.8), 0.36)):
        light = pv.Light(position=place, light_type="camera light", intensity=strength)
        plotter.add_light(light)
    # Smoothing is switched by `smooth`, for pictures that stay.
    plotter.render_window.SetMultiSamples(0)
    return plotter


def is_software(plotter: Plotter) -> bool:
    """True if OpenGL is rendered in software, on the CPU; known once something was drawn."""
    return any(name in plotter.render_window.ReportCapabilities() for name in SOFTWARE)


def smooth(plotter: Plotter, on: bool) -> None:
    """Smooth edges in the pictures that follow, or not."""
    if on:
        plotter.enable_anti_aliasing("ssaa")
    else:
        plotter.disable_anti_aliasing()


def to_poly(surface: Surface, **point_data: np.ndarray) -> pv.PolyData:
    """A mesh with normals that are smooth but for creases.

    Args:
        surface: vertices (v, 3) and faces (f, 3).
        point_data: arrays (v, ...) to keep with the vertices.
    """
    import pyvista as pv

    vertices, faces = surface
    if not len(faces):
        return pv.PolyData()
    poly: Any = pv.PolyData.from_regular_faces(np.asarray(vertices, np.float32), faces)
    for name, values in point_data.items():
        poly.point_data[name] = values
    return poly.compute_normals(
        cell_normals=False,
        split_vertices=True,
        feature_angle=CREASE,
        consistent_normals=False,
        non_manifold_traversal=False,
    )


def to_edges(surface: Surface) -> pv.PolyData:
    """Lines along the creases of a mesh."""
    import pyvista as pv

    vertices, faces = surface
    if not len(faces):
        return pv.PolyData()
    poly: Any = pv.PolyData.from_regular_faces(np.asarray(vertices, np.float32), faces)
    return poly.extract_feature_edges(
        feature_angle=CREASE,
        boundary_edges=False,
        non_manifold_edges=False,
        manifold_edges=False,
        clear_data=True,
    )


def _write_text_as_it_is() -> None:
    """Names are text: without this VTK would read mathematics between dollar signs."""
    from vtkmodules.vtkRenderingCore import vtkTextRenderer

    renderer: Any = vtkTextRenderer.GetInstance()
    if renderer is not None:
        renderer.SetDefaultBackend(vtkTextRenderer.FreeType)
