"""Scenes drawn off-screen: silhouettes against the traced field, layers, what an edit makes anew."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from viewer_scenes import chain, need_drawing, primitive

from resfit.assembly.assembly import Assembly
from resfit.assembly.transform import Transform
from resfit.kernels.render.camera import camera_rays, tile_counts
from resfit.kernels.render.sdf_scene import SdfScene
from resfit.kernels.render.sphere_trace import NO_HIT
from resfit.kernels.runtime.launch import choose_device
from resfit.viewer.model.comparison import Comparison
from resfit.viewer.model.edit_session import EditSession
from resfit.viewer.model.view_options import View
from resfit.viewer.scene import part_actors
from resfit.viewer.scene.arrangement import arrange, exploded
from resfit.viewer.scene.camera import OrbitCamera
from resfit.viewer.scene.scene import Scene
from resfit.viewer.scene.screenshot import grab
from resfit.viewer.scene.section import cut_face, distance_bands
from resfit.viewer.scene.surface_cache import LIVE_CELLS, PART_CELLS, PartSurfaces, joined_surface, shape_key

SIZE = (320, 240)


@pytest.fixture
def plotter() -> Iterator[object]:
    """An off-screen plotter."""
    need_drawing()
    from resfit.viewer.scene.plotter import make_plotter

    made = make_plotter(SIZE, off_screen=True)
    yield made
    made.close()


@pytest.fixture(scope="module")
def mesh_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The surface of the chain without its last part, as a mesh file in its own frame."""
    path = tmp_path_factory.mktemp("mesh") / "chain.ply"
    whole = chain()
    replace(whole, primitives=whole.primitives[:3]).to_mesh(64).export(path)
    return path


def drawn_silhouette(plotter) -> np.ndarray:
    """(height, width) bool, what is not background."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkFloatArray

    plotter.show(auto_close=False)
    plotter.render()
    width, height = SIZE
    depth = vtkFloatArray()
    plotter.render_window.GetZbufferData(0, 0, width - 1, height - 1, depth)
    return vtk_to_numpy(depth).reshape(height, width)[::-1] < 1.0


def traced_silhouette(assembly: Assembly, camera: OrbitCamera) -> np.ndarray:
    """The same from the field itself, without any mesh."""
    width, height = SIZE
    scene = SdfScene(assembly.on_device("cpu"), np.ones((len(assembly.primitives), 3)))
    rays = camera_rays(camera.view(), width, height, choose_device("cpu"))
    hits = scene.hit(rays, 1e-4).numpy() < NO_HIT
    across, down = tile_counts(width, height)
    return (
        hits.reshape(down, across, 8, 8).transpose(0, 2, 1, 3).reshape(down * 8, across * 8)[:height, :width]
    )


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


@pytest.mark.parametrize("joined", [False, True])
def test_silhouettes_are_those_of_the_field(plotter, joined: bool) -> None:
    assembly = chain(blend=0.12 if joined else 0.0)
    scene = Scene(plotter, EditSession([assembly]), view=View(joined=joined, edges=False))
    shape = drawn_silhouette(plotter)
    assert 0.05 < shape.mean() < 0.9
    assert overlap(shape, traced_silhouette(assembly, scene.camera)) >= 0.98


def test_silhouette_after_an_edit_and_after_undo(plotter) -> None:
    edits = EditSession([chain()])
    scene = Scene(plotter, edits)
    before = drawn_silhouette(plotter)
    edits.editor.set_value(edits.refs()[1], "size.1", 1.1)
    edits.editor.set_value(edits.refs()[0], "rotation.2", 45.0)
    scene.sync(live=True)
    edited = drawn_silhouette(plotter)
    assert overlap(edited, traced_silhouette(edits.state.assemblies[0], scene.camera)) >= 0.97
    assert overlap(edited, before) < 0.9
    edits.undo()
    scene.sync()
    assert (drawn_silhouette(plotter) == before).all()


def test_only_what_an_edit_touches_is_made_anew(plotter) -> None:
    edits = EditSession([chain()])
    scene = Scene(plotter, edits)
    ref, surfaces = edits.refs()[2], scene.parts.surfaces
    made = surfaces.made
    for action in (
        lambda: edits.editor.set_value(ref, "translation.0", 0.4),
        lambda: edits.editor.set_value(ref, "rotation.0", 33.0),
        lambda: edits.editor.set_value(ref, "blend", 0.2),
        lambda: edits.hide(ref),
        edits.show_all,
        lambda: edits.duplicate(ref),
    ):
        action()
        scene.sync()
    assert surfaces.made == made
    edits.editor.set_value(ref, "size.0", 0.77)
    scene.sync(live=True)
    assert surfaces.made == made + 1
    scene.sync()
    assert surfaces.made == made + 2
    edits.undo()
    scene.sync()
    assert surfaces.made == made + 2


@pytest.mark.parametrize("fewer", [False, True])
def test_many_parts_are_drawn_coarsely(plotter, monkeypatch: pytest.MonkeyPatch, fewer: bool) -> None:
    whole = chain()
    monkeypatch.setattr(part_actors, "MANY_PARTS", len(whole.primitives) - 1 + fewer)
    scene = Scene(plotter, EditSession([whole]))
    expected = PART_CELLS if fewer else LIVE_CELLS
    assert {part.shape for part in scene.parts.parts.values()} == {
        shape_key(part, expected) for part in whole.primitives
    }


def test_parts_keep_their_colours_and_hidden_ones_go(plotter) -> None:
    edits = EditSession([chain()])
    scene = Scene(plotter, edits)
    ref = edits.refs()[0]
    colors = {key: part.body.prop.color.hex_rgb for key, part in scene.parts.parts.items()}
    assert colors == {key: edits.part(key).color for key in edits.refs()}
    edits.hide(ref)
    scene.sync()
    assert set(scene.parts.parts) == set(edits.refs()) - {ref}


def test_picking_finds_the_part_under_a_pixel_alone_and_joined(plotter) -> None:
    edits = EditSession([chain()])
    scene = Scene(plotter, edits, camera=OrbitCamera(azimuth=0.0, elevation=0.0))
    drawn_silhouette(plotter)
    for joined in (False, True):
        scene.view = View(joined=joined)
        scene.sync()
        for ref in edits.refs():
            renderer = plotter.renderer
            renderer.SetWorldPoint(*edits.part(ref).pose.translation, 1.0)
            renderer.WorldToDisplay()
            x, y, _ = renderer.GetDisplayPoint()
            assert scene.pick(x, y) == ref
    assert scene.pick(2, 2) is None


def test_every_layer_draws_and_goes_again(plotter, mesh_path: Path) -> None:
    scene = Scene(plotter, EditSession([chain()]), [Comparison(mesh_path)])
    views = [
        View(mesh="ghost"), View(mesh="outline"), View(mesh="beside"), View(error=True), View(residual=True),
        View(samples=True), View(slice=True), View(section="x"), View(section="y", slice=True), View(labels=True),
        View(wireframe=True), View(explode=0.5), View(joined=True, section="z"),
    ]  # fmt: skip
    plain = grab(plotter)
    for view in views:
        scene.view = view
        scene.sync()
        assert np.abs(grab(plotter).astype(int) - plain).max() > 20, view
        scene.view = View()
        scene.sync()
        assert (grab(plotter) == plain).all(), view


def test_names_are_shown_as_text(plotter) -> None:
    # Mathematics between dollar signs would be set by another program; the letters of markup are just letters.
    part = primitive("cuboid", "$\\frac{1}{2}$ <b>x</b>\\n", (0.0, 0.0, 0.0))
    scene = Scene(plotter, EditSession([Assembly((part,))]), view=View(labels=True))
    plotter.show(auto_close=False)
    from vtkmodules.vtkRenderingCore import vtkTextRenderer

    assert vtkTextRenderer.GetInstance().GetDefaultBackend() == vtkTextRenderer.FreeType
    assert len(scene.layers.drawn) == 1


def test_iou_residual_and_distances_of_a_known_difference(mesh_path: Path) -> None:
    compared, whole = Comparison(mesh_path), chain()
    part = replace(whole, primitives=whole.primitives[:3])
    assert compared.iou(part) > 0.97 and abs(compared.iou(part, live=True) - compared.iou(part)) < 0.02
    missing, excess = compared.residual(whole)
    assert not len(missing[1]) and len(excess[1])
    centre = compared.transform.to_normalised(
        whole.transform.to_mesh([whole.primitives[3].pose.translation])
    )[0]
    assert np.linalg.norm(excess[0].mean(axis=0) - centre) < 0.2
    missing, excess = compared.residual(replace(whole, primitives=whole.primitives[:2]))
    assert len(missing[1]) and not len(excess[1])
    vertices, faces = compared.fine_surface
    distances = compared.distances(part, vertices)
    # Mesh units: within a cell of the mesh, whose longest side is 4 of them.
    assert np.abs(distances).max() < 0.05 and faces.max() < len(vertices)


def test_several_assemblies_lie_in_one_frame_or_side_by_side(mesh_path: Path) -> None:
    small = replace(chain(), transform=Transform(1.25, (102.5, -20.0, 3.0)))
    edits, compared = EditSession([chain(), small]), Comparison(mesh_path)
    placed = arrange(edits, View(), [compared, compared]).placed
    np.testing.assert_allclose(
        placed[1].matrix, [[0.5, 0, 0, 1], [0, 0.5, 0, 0], [0, 0, 0.5, 0], [0, 0, 0, 1]]
    )
    assert [entry.shows_mesh for entry in placed] == [True, False]
    beside = arrange(edits, View(mesh="beside"), [compared, compared]).placed
    middles = [beside[0].mesh_matrix[0, 3], *(entry.matrix[0, 3] for entry in beside)]
    assert middles == sorted(middles) and middles[1] - middles[0] > 1.0


def test_exploded_parts_move_away_from_their_middle() -> None:
    assembly = chain(blend=0.1)
    assert exploded(assembly, 0.0) is assembly
    moved = exploded(assembly, 1.0)
    assert [part.blend for part in moved.primitives] == [0.0] * 4
    middle = np.mean([part.pose.translation for part in assembly.primitives], axis=0)
    for before, after in zip(assembly.primitives, moved.primitives, strict=True):
        expected = 2.0 * np.asarray(before.pose.translation) - middle
        np.testing.assert_allclose(after.pose.translation, expected, atol=1e-6)


def test_cut_faces_and_bands_follow_the_field() -> None:
    assembly = chain()
    box = (np.full(3, -1.0), np.full(3, 1.0))
    face = cut_face(assembly, 2, 0.0, box)
    rows, columns, _ = face.image.shape
    u = face.low[0] + (np.arange(columns) + 0.5) * (face.high[0] - face.low[0]) / columns
    v = face.low[1] + (np.arange(rows) + 0.5) * (face.high[1] - face.low[1]) / rows
    grid = np.stack(np.meshgrid(u, v, indexing="xy"), axis=-1)
    points = np.concatenate([grid, np.zeros((rows, columns, 1))], axis=-1).reshape(-1, 3)
    inside = (assembly.sdf(assembly.transform.to_mesh(points)) < 0.0).reshape(rows, columns)
    assert ((face.image[:, :, 3] > 0) == inside).mean() > 0.999
    bands = distance_bands(assembly, 2, 0.0, box).image.astype(int)
    # Blue inside, orange outside.
    assert (bands[inside][:, 2] >= bands[inside][:, 0]).all()
    assert (bands[~inside][:, 0] >= bands[~inside][:, 2]).all()


def test_joined_surfaces_know_the_owner_of_each_face() -> None:
    assembly = chain()
    surface = joined_surface(assembly, 64)
    centres = surface.vertices[surface.faces].mean(axis=1)
    places = np.array([part.pose.translation for part in assembly.primitives])
    for index in range(4):
        mine = centres[surface.owners == index]
        assert len(mine) and np.linalg.norm(mine.mean(axis=0) - places[index]) < 0.1
    assert len(joined_surface(Assembly(), 64).faces) == 0


def test_surfaces_are_kept_by_shape_and_the_oldest_go(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("resfit.viewer.scene.surface_cache.CAPACITY", 2)
    surfaces = PartSurfaces("cpu")
    a, b, c, _ = chain().primitives
    for part in (a, b, replace(a, name="copy", blend=0.3), c):
        surfaces.surface(part, 8)
    assert surfaces.made == 3 and surfaces.has(c, 8) and surfaces.has(a, 8) and not surfaces.has(b, 8)
