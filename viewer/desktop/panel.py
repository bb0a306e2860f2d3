"""Paints a panel's layout over the scene: one mesh of flat shapes, and a line of text each."""

from __future__ import annotations

from typing import Any

from ...assembly.colors import rgb
from ..scene.plotter import Plotter
from .panel_layout import Drawing, Shape, Text


class Panel:
    """A transparent layer over the whole window.

    Attributes:
        drawing: what was painted last.
    """

    def __init__(self, plotter: Plotter, layer: int) -> None:
        """Lie over the layers of a plotter's window that are below `layer`."""
        from vtkmodules.vtkCommonDataModel import vtkPolyData
        from vtkmodules.vtkRenderingCore import vtkActor2D, vtkPolyDataMapper2D, vtkRenderer

        self.drawing = Drawing()
        self.window: Any = plotter.render_window
        self.renderer: Any = vtkRenderer()
        self.renderer.SetLayer(layer)
        self.renderer.InteractiveOff()
        self.window.SetNumberOfLayers(max(layer + 1, self.window.GetNumberOfLayers()))
        self.window.AddRenderer(self.renderer)
        # Sizes of text count in pixels then.
        self.window.SetDPI(72)
        self._mesh: Any = vtkPolyData()
        mapper: Any = vtkPolyDataMapper2D()
        mapper.SetInputData(self._mesh)
        actor: Any = vtkActor2D()
        actor.SetMapper(mapper)
        self.renderer.AddViewProp(actor)
        self._texts: list[tuple[Any, Text | None]] = []
        self._painted: tuple[tuple[Shape, ...], int] = ((), 0)

    def paint(self, drawing: Drawing) -> None:
        """Show a drawing; only what differs from the last one is touched."""
        self.drawing = drawing
        height = int(self.window.GetSize()[1])
        shapes = tuple(drawing.shapes)
        moved = height != self._painted[1]
        if moved or shapes != self._painted[0]:
            self._paint_shapes(shapes, height)
            self._painted = shapes, height
        while len(self._texts) < len(drawing.texts):
            self._texts.append((self._text_actor(), None))
        for k, (actor, before) in enumerate(self._texts):
            wanted = drawing.texts[k] if k < len(drawing.texts) else None
            if wanted != before or moved:
                _write(actor, wanted, height)
                self._texts[k] = actor, wanted

    def _paint_shapes(self, shapes: tuple[Shape, ...], height: int) -> None:
        from vtkmodules.vtkCommonCore import vtkPoints, vtkUnsignedCharArray
        from vtkmodules.vtkCommonDataModel import vtkCellArray

        points, polygons, colors = vtkPoints(), vtkCellArray(), vtkUnsignedCharArray()
        colors.SetNumberOfComponents(4)
        for shape in shapes:
            polygons.InsertNextCell(len(shape.points))
            for x, y in shape.points:
                polygons.InsertCellPoint(points.InsertNextPoint(x, height - y, 0.0))
            colors.InsertNextTuple4(*shape.color)
        self._mesh.SetPoints(points)
        self._mesh.SetPolys(polygons)
        self._mesh.GetCellData().SetScalars(colors)
        self._mesh.Modified()

    def _text_actor(self) -> Any:
        from vtkmodules.vtkRenderingCore import vtkTextActor

        actor: Any = vtkTextActor()
        actor.SetTextScaleModeToNone()
        style = actor.GetTextProperty()
        style.SetFontFamilyToArial()
        style.SetVerticalJustificationToCentered()
        style.SetUseTightBoundingBox(0)
        self.renderer.AddViewProp(actor)
        return actor


def _write(actor: Any, text: Text | None, height: int) -> None:
    actor.SetVisibility(text is not None)
    if text is None:
        return
    actor.SetInput(text.text)
    actor.SetPosition(round(text.x), round(height - text.y))
    style = actor.GetTextProperty()
    style.SetFontSize(text.size)
    style.SetColor(*rgb(text.color))
    style.SetBold(text.bold)
    {
        "left": style.SetJustificationToLeft,
        "center": style.SetJustificationToCentered,
        "right": style.SetJustificationToRight,
    }[text.align]()
