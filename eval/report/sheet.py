"""A picture of a comparison: each input and what every method made of it, coloured by primitive."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from ...assembly.assembly import Assembly
from ...assembly.atomic_write import write_bytes
from ...assembly.change_of_frame import rows_in_frame
from ...assembly.colors import palette_color, rgb
from ...assembly.primitive import Primitive
from ...assembly.surface import part_surface
from ...assembly.transform import Transform, up_axis
from ...kernels.field.primitive_set import PrimitiveSet
from ...kernels.mesh.mesh_query import MeshQuery
from ...kernels.primitives import family
from ...kernels.render.camera import Camera, frame_bounds
from ...kernels.render.mesh_scene import MeshScene
from ...kernels.render.raytrace import CLAY, render, render_assembly, render_mesh
from ...kernels.render.shading import to_linear
from ...kernels.rows import BLEND, SHAPES
from ...kernels.runtime.launch import choose_device
from ...kernels.srgb import to_srgb
from ...shape.load import load_mesh
from ..batch.datasets import Shape
from ..metrics.prediction_files import Source, read_prediction
from ..metrics.prediction_parts import PartMesh, joined, turned_outwards
from .contact_sheet import COLORS, FAINT, GAP, INK, PAPER

PANEL = (240, 200)
"""Width and height of one picture, in pixels."""
CAPTION, HEADING = 20, 26
SAMPLES = 2
PART_CELLS = 32
"""Cells along a part's longest side, where parts are meshed to be shown: an edge is as long as a few pixels."""
MAX_SHAPES = 24
"""More would make a picture that nobody can look at; of more, as many are taken evenly."""
"""Formats of CAD, where z points up."""


def write_sheet(rows: Sequence[dict[str, Any]], shapes: Sequence[Shape], out: Path, path: Path) -> None:
    """Draw the contact sheet of a comparison.

    Args:
        rows: of the comparison.
        shapes: its meshes.
        out: the folder that the rows' predictions are in.
        path: the PNG file to write.
    """
    from PIL import Image, ImageDraw, ImageFont

    methods = list(dict.fromkeys(row["method"] for row in rows))
    picked = [shapes[index] for index in np.unique(np.linspace(0, len(shapes) - 1, MAX_SHAPES).astype(int))]
    width = (len(methods) + 1) * (PANEL[0] + GAP) + GAP
    height = HEADING + len(picked) * (PANEL[1] + CAPTION + GAP) + GAP
    sheet = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(sheet)
    bold, small = ImageFont.load_default(15), ImageFont.load_default(12)
    for column, name in enumerate(["input", *methods]):
        draw.text((GAP + column * (PANEL[0] + GAP) + 2, 6), name, fill=INK, font=bold)
    for line, shape in enumerate(picked):
        top = HEADING + line * (PANEL[1] + CAPTION + GAP)
        found = {row["method"]: row for row in rows if row["mesh"] == shape.name}
        for column, panel in enumerate(_panels(shape, [found.get(method) for method in methods], out)):
            left = GAP + column * (PANEL[0] + GAP)
            image, caption = panel
            if image is None:
                draw.rectangle((left, top, left + PANEL[0], top + PANEL[1]), fill=(242, 243, 245))
            else:
                sheet.paste(Image.fromarray(image), (left, top))
            while draw.textlength(caption, font=small) > PANEL[0] - 4:
                caption = caption.rstrip("…")[:-1].rstrip() + "…"
            draw.text((left + 2, top + PANEL[1] + 3), caption, fill=FAINT, font=small)
    buffer = BytesIO()
    sheet.quantize(COLORS, dither=Image.Dither.NONE).save(buffer, "PNG", optimize=True)
    write_bytes(path, buffer.getvalue())


def _panels(
    shape: Shape, rows: Sequence[dict[str, Any] | None], out: Path
) -> list[tuple[np.ndarray | None, str]]:
    """Picture and caption of a shape and of each of its rows; no picture where there is nothing to show."""
    try:
        mesh = load_mesh(shape.path)
    except Exception as error:
        return [(None, f"{shape.name}: {error}"), *((None, "") for _ in rows)]
    lower, upper = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    frame = Transform.from_bounds(lower, upper)
    box = frame.to_normalised(np.stack([lower, upper]))
    camera = frame_bounds(box[0], box[1], up=up_axis(shape.path.name), aspect=PANEL[0] / PANEL[1])
    vertices = frame.to_normalised(mesh.vertices)
    panels: list[tuple[np.ndarray | None, str]] = [
        (render_mesh(vertices, mesh.faces, camera, *PANEL, samples=SAMPLES), shape.name)
    ]
    for row in rows:
        if row is None or row["status"] != "ok":
            panels.append((None, "not run" if row is None else row["error"]))
            continue
        numbers = f"IoU {row['iou']:.3f}, {row['primitive_count']} parts, {row['cpu_s']:.1f} CPU s"
        try:
            image = _render_prediction(read_prediction(out / row["prediction"]), frame, camera)
        except Exception as error:
            # The sheet is worth having without one of its pictures.
            image, numbers = None, str(error)
        panels.append((image, numbers))
    return panels


def _render_prediction(source: Source, frame: Transform, camera: Camera) -> np.ndarray:
    """Picture (height, width, 3) uint8 of a prediction, each primitive in its colour.

    Args:
        source: what `read_prediction` gave.
        frame: the target's.
        camera: in its normalised frame.
    """
    if not isinstance(source, Assembly):
        return _render_parts([turned_outwards(part) for part in source.placed(None, frame)], camera)
    names = [primitive.family for primitive in source.primitives]
    if any(family(name).approximate for name in names):
        # Marching along a field that is only roughly a distance takes ten times as long as showing meshes.
        return _render_parts([_shown(part, source, frame) for part in source.primitives], camera)
    primitives = PrimitiveSet(rows_in_frame(source, frame), names, choose_device("cpu"))
    return render_assembly(primitives, _part_colors(len(primitives)), camera, *PANEL, samples=SAMPLES)


def _shown(part: Primitive, assembly: Assembly, frame: Transform) -> PartMesh:
    """The surface of a part of an assembly, in the normalised frame."""
    entry = family(part.family)
    if entry.mesh is not None:
        vertices, faces = entry.mesh(part.row()[SHAPES:BLEND])
    else:
        vertices, faces = part_surface(part, PART_CELLS, "cpu")
    placed = vertices @ part.pose.matrix().T + np.asarray(part.pose.translation)
    return PartMesh(frame.to_normalised(assembly.transform.to_mesh(placed)), np.asarray(faces))


def _part_colors(count: int) -> np.ndarray:
    """Colours (count, 3), sRGB in [0, 1], the same for every method."""
    return np.array([rgb(palette_color(index)) for index in range(count)]).reshape(-1, 3)


def _render_parts(parts: Sequence[PartMesh], camera: Camera) -> np.ndarray:
    """Picture (height, width, 3) uint8 of meshes: all of them in clay, then what is seen of each is coloured."""
    width, height = PANEL[0] * SAMPLES, PANEL[1] * SAMPLES
    if not parts:
        return render_mesh(np.zeros((0, 3)), np.zeros((0, 3), int), camera, *PANEL)
    vertices, faces = joined(parts)
    device = choose_device("cpu")
    # The samples of a pixel share its soft light, though they are pixels here.
    scene = MeshScene(vertices, faces, CLAY, device, False, SAMPLES * SAMPLES)
    clay = render(scene, camera, width, height, 1, True)
    origin, direction = _pixel_rays(camera, width, height)
    query = MeshQuery(vertices, faces, device)
    begin = wp.array(np.ascontiguousarray(origin, np.float32), dtype=wp.vec3, device=device)
    way = wp.array(np.ascontiguousarray(direction, np.float32), dtype=wp.vec3, device=device)
    face = query.cast_rays(begin, way).face.numpy()
    part_of_face = np.repeat(np.arange(len(parts)), [len(part.faces) for part in parts])
    # The last entry is for the background.
    tints = np.ones((len(parts) + 1, 3), np.float32)
    tints[:-1] = to_linear(_part_colors(len(parts))) / to_linear(np.array(CLAY))
    tint = tints[np.where(face >= 0, part_of_face[np.maximum(face, 0)], -1)]
    light = np.clip(to_linear(clay / 255.0) * tint.reshape(height, width, 3), 0.0, 1.0)
    shown = to_srgb(light)
    blocks = shown.reshape(PANEL[1], SAMPLES, PANEL[0], SAMPLES, 3).mean(axis=(1, 3))
    return (blocks * 255.0 + 0.5).astype(np.uint8)


def _pixel_rays(camera: Camera, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Origins and unit directions (width * height, 3) of rays through the pixels, row by row from the top."""
    right, up, forward = camera.axes
    scale = 2.0 * np.tan(np.radians(0.5 * camera.field_of_view)) / height
    x = (np.arange(width) + 0.5 - 0.5 * width) * scale
    y = (0.5 * height - np.arange(height) - 0.5) * scale
    ways = forward + x[None, :, None] * right + y[:, None, None] * up
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    return np.broadcast_to(np.array(camera.position), (width * height, 3)), ways.reshape(-1, 3)
