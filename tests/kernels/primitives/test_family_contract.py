"""What every primitive family promises (kernels/primitives/family.py), checked on sampled shapes and points."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING

import numpy as np
import pytest
import warp as wp

from resfit.assembly.primitive import Primitive
from resfit.kernels.field.culling import cull, every_primitive
from resfit.kernels.field.evaluate import evaluate_primitives, union_at
from resfit.kernels.field.jacobian import jacobian
from resfit.kernels.field.points import point_blocks
from resfit.kernels.field.primitive_set import PrimitiveSet
from resfit.kernels.primitives import FAMILIES, Family
from resfit.kernels.primitives.parameters import Values
from resfit.kernels.primitives.swept_solids import box_solids
from resfit.kernels.rows import SHAPE, SHAPES, empty_rows
from resfit.kernels.runtime.launch import choose_device

if TYPE_CHECKING:
    from playwright.sync_api import Browser

SHAPES_TRIED = 24
POINTS = 2000

every_family = pytest.mark.parametrize("entry", FAMILIES.values(), ids=list(FAMILIES))


def random_shapes(entry: Family, rng: np.random.Generator, count: int = SHAPES_TRIED) -> np.ndarray:
    """Shapes (count, SHAPE) inside the fit range, lengths of the order of 1."""
    low, high = entry.fit_range
    for parameter in entry.parameters:
        if parameter.unit == "length":
            columns = entry.columns(parameter.name)
            low[columns] = np.maximum(low[columns], 0.1 * parameter.slider[1])
            high[columns] = np.minimum(high[columns], 0.5 * parameter.slider[1])
    return rng.uniform(low, high, (count, SHAPE)).astype(np.float32)


def values(entry: Family, shape: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The field (n,) of one shape (SHAPE,) at local points (n, 3)."""
    row = empty_rows(1)
    row[0, SHAPES : SHAPES + SHAPE] = shape
    return evaluate_primitives(PrimitiveSet(row, [entry.name], choose_device("cpu")), points)[0]


def around(entry: Family, shape: np.ndarray, rng: np.random.Generator, share: float = 0.6) -> np.ndarray:
    """Points (POINTS, 3) in a box around the shape; `share` 0.5 is its own box."""
    low, high = entry.bounds(shape)
    return (0.5 * (low + high) + (high - low) * rng.uniform(-share, share, (POINTS, 3))).astype(np.float32)


@every_family
def test_the_table_fits_into_a_row(entry: Family) -> None:
    names = [parameter.name for parameter in entry.parameters]
    assert entry.parameter_count <= SHAPE
    assert len(set(names)) == len(names)
    assert list(FAMILIES).index(entry.name) == entry.index
    assert all(parameter.unit in ("length", "ratio") for parameter in entry.parameters)
    assert "size" not in names or (names[0] == "size" and entry.parameters[0].count == 3)
    assert set(entry.lengths) <= set(range(entry.parameter_count))


@every_family
def test_a_row_gives_the_primitive_back(entry: Family, rng: np.random.Generator) -> None:
    for shape in random_shapes(entry, rng, 4):
        row = empty_rows(1)[0]
        row[SHAPES : SHAPES + SHAPE] = shape
        np.testing.assert_array_equal(Primitive.from_row(entry.name, "part", row).row(), row)


@every_family
def test_lengths_scale_with_the_frame(entry: Family, rng: np.random.Generator) -> None:
    """And nothing else does: the field of the scaled shape is the scaled field."""
    for shape in random_shapes(entry, rng, 4):
        scaled, points = shape.copy(), around(entry, shape, rng)
        scaled[entry.lengths] *= 2.0
        np.testing.assert_allclose(
            values(entry, scaled, 2.0 * points), 2.0 * values(entry, shape, points), atol=2e-5
        )


@every_family
def test_derivatives_are_those_of_the_field(entry: Family, rng: np.random.Generator) -> None:
    """Against central differences, to the point and to every parameter, but at creases."""
    step, wrong, checked = 2e-3, 0, 0
    device = choose_device("cpu")
    for shape in random_shapes(entry, rng, 12):
        points = around(entry, shape, rng)[:400]
        row = empty_rows(1)
        row[0, SHAPES : SHAPES + SHAPE] = shape
        found_values, found = jacobian(
            PrimitiveSet(row, [entry.name], device), points, np.zeros(len(points), int)
        )
        np.testing.assert_allclose(found_values, values(entry, shape, points), atol=1e-5)
        # The translation moves the primitive, which is the opposite of moving the point.
        gradient = np.concatenate([-found[:, :3], found[:, 6 : 6 + entry.parameter_count]], axis=1)
        for column in range(gradient.shape[1]):
            sides = []
            for direction in (step, -step):
                at, moved = points.copy(), shape.copy()
                if column < 3:
                    at[:, column] += direction
                else:
                    moved[column - 3] += direction
                sides.append(values(entry, moved, at))
            slope = (sides[0] - sides[1]) / (2.0 * step)
            middle = values(entry, shape, points)
            # Where the two one-sided differences disagree, there is a crease or a place too curved to tell.
            smooth = np.abs(sides[0] + sides[1] - 2.0 * middle) / step < 0.02 * (1.0 + np.abs(slope))
            error = np.abs(gradient[:, column] - slope)[smooth]
            checked += int(smooth.sum())
            wrong += int((error > 0.03 * (1.0 + np.abs(slope[smooth]))).sum())
    assert checked > 0.7 * 12 * 400 * 3
    assert wrong <= 0.005 * checked, f"{wrong} of {checked}"


@every_family
def test_the_surface_is_in_the_box(entry: Family, rng: np.random.Generator) -> None:
    """No point outside the box is inside the solid, and the box is not much larger than needed."""
    for shape in random_shapes(entry, rng):
        low, high = entry.bounds(shape)
        assert (low < high).all()
        points = around(entry, shape, rng, 1.0)
        inside = values(entry, shape, points) < -1e-5
        assert not (inside & ((points < low - 1e-5) | (points > high + 1e-5)).any(axis=1)).any()
    extents = entry.extents(random_shapes(entry, rng, 3))
    assert extents.shape == (3, 3)
    assert (extents > 0.0).all()


@every_family
def test_reach_bounds_the_change_of_the_field(entry: Family, rng: np.random.Generator) -> None:
    """Culling by it leaves no value different."""
    device = choose_device("cpu")
    rows = empty_rows(6)
    rows[:, SHAPES : SHAPES + SHAPE] = random_shapes(entry, rng, 6)
    rows[:, :3] = rng.uniform(-0.8, 0.8, (6, 3))
    primitives = PrimitiveSet(rows, [entry.name] * 6, device)
    # Blocks of points that lie together, of every size.
    middles = rng.uniform(-1.5, 1.5, (40, 1, 3))
    points = middles + rng.uniform(-1.0, 1.0, (40, 64, 3)) * rng.choice([0.01, 0.1, 0.5], (40, 1, 1))
    blocks = point_blocks(points.reshape(-1, 3).astype(np.float32), device)
    both = [
        union_at(primitives, blocks, lists=lists).numpy()[: blocks.count]
        for lists in (every_primitive(primitives, blocks), cull(primitives, blocks))
    ]
    np.testing.assert_allclose(both[0], both[1], atol=1e-6)


@every_family
def test_a_slope_and_a_step_hold_but_for_few_points(entry: Family, rng: np.random.Generator) -> None:
    """No field is steeper than its slope; a safe step ends before the solid or inside, never behind it."""
    steep, jumped, tried = 0, 0, 0
    for shape in random_shapes(entry, rng):
        points = around(entry, shape, rng)
        found = values(entry, shape, points)
        near = points + (1e-2 * rng.normal(size=points.shape)).astype(np.float32)
        change = np.abs(values(entry, shape, near) - found)
        if not entry.approximate:
            steep += int(
                (change > 1.01 * entry.slope(shape) * np.linalg.norm(near - points, axis=1) + 1e-5).sum()
            )
        directions = rng.normal(size=points.shape)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        length = max(entry.step(shape), 0.08) * np.maximum(found, 0.0)
        entered, there = np.zeros(len(points), bool), found
        for share in np.linspace(0.1, 0.999, 10):
            at = (points + directions * (share * length)[:, None]).astype(np.float32)
            there = values(entry, shape, at)
            entered |= (found > 0.0) & (there < -1e-3)
        jumped += int((entered & (there > 0.0)).sum())
        tried += len(points)
    assert steep <= 0.005 * tried
    assert jumped <= 0.005 * tried


TURNS = {
    "half_turn_z": np.diag([-1.0, -1.0, 1.0]),
    "half_turn_x": np.diag([1.0, -1.0, -1.0]),
    "quarter_turn_z": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "axis_order": np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
    "revolution": np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]),
}


@every_family
def test_symmetries_are_those_of_the_field(entry: Family, rng: np.random.Generator) -> None:
    for shape in random_shapes(entry, rng, 8):
        points = around(entry, shape, rng, 0.7)
        mirrored = points * np.float32([1.0, -1.0, 1.0])
        np.testing.assert_allclose(
            values(entry, shape, mirrored),
            values(entry, shape, points),
            atol=1e-5,
            err_msg="mirrored in y = 0",
        )
        for name, turn in TURNS.items():
            wanted: Values | None = getattr(entry.symmetries, name)
            if wanted is None:
                continue
            symmetric = entry.with_values(shape, wanted)
            if entry.has("size"):
                size = symmetric[entry.columns("size")]
                if name == "revolution":
                    size[1] = size[0]
            assert entry.revolves(symmetric) or name != "revolution"
            turned = symmetric.copy()
            if entry.has("size") and name in ("quarter_turn_z", "axis_order"):
                size = turned[entry.columns("size")]
                size[:] = np.abs(turn).T @ size
            # The solid of the relabelled shape, turned, is the solid: |p| in one is |turn^T p| in the other.
            np.testing.assert_allclose(
                values(entry, turned, (points @ turn).astype(np.float32)),
                values(entry, symmetric, points),
                atol=2e-5 * max(1.0, float(np.abs(points).max())),
                err_msg=name,
            )


@every_family
def test_canonical_changes_are_small(entry: Family, rng: np.random.Generator) -> None:
    """A shape that is canonical but for rounding keeps its surface, and once canonical it stays so."""
    for shape, rule in product(random_shapes(entry, rng, 8), entry.rules):
        canonical = rule.impose(entry, shape, NEAR_VALUES.get(rule.name, 0.0))
        assert rule.change(entry, canonical) is None
        for column in range(entry.parameter_count):
            nearly = canonical.copy()
            nearly[column] += 1e-4 * (1.0 if nearly[column] <= 0.0 else -1.0)
            change = rule.change(entry, nearly)
            if change is None:
                continue
            assert change.distance <= rule.rounding
            points = around(entry, shape, rng)
            shift = np.zeros(3) if change.shift is None else change.shift
            before, after = (
                values(entry, nearly, points),
                values(entry, change.shape, points - np.float32(shift)),
            )
            surface = np.abs(before) < 0.02
            assert np.quantile(np.abs(after - before)[surface], 0.98) < 1e-3
            assert rule.change(entry, change.shape) is None


NEAR_VALUES = {"onion": -1.0, "taper": 1.0, "roundness": 1.0}
"""Canonical values of parameters that have another than 0."""


@every_family
def test_the_cheaper_field_is_the_same_where_it_may_be_used(entry: Family, rng: np.random.Generator) -> None:
    """Blocks of one point use the cheaper form, those that hold a point of the seam zone the other one."""
    if entry.fast is None:
        assert entry.fast_grad is None
        assert entry.seam_zone is None
        return
    assert entry.fast_grad is not None
    assert entry.seam_zone is not None
    for shape in random_shapes(entry, rng, 8):
        cheap, whole, zone = field_forms(entry, shape, around(entry, shape, rng))
        outside = zone <= 0.0
        assert outside.mean() > 0.2
        np.testing.assert_allclose(cheap[outside], whole[outside], atol=1e-5)


def field_forms(entry: Family, shape: np.ndarray, points: np.ndarray) -> list[np.ndarray]:
    """`fast`, `sdf` and `seam_zone` (n,) of one shape at points (n, 3)."""
    derive, forms = entry.derive, (entry.fast, entry.sdf, entry.seam_zone)
    fast, sdf, seam_zone = forms

    @wp.kernel(module="unique", enable_backward=False)
    def forms_kernel(
        row: wp.array[float], points: wp.array[wp.vec3], out_values: wp.array2d[float]
    ):  # numpydoc ignore=GL08
        i = wp.tid()
        table = derive(row, 0)
        p = points[i]
        out_values[0, i] = fast(table, p[0], p[1], p[2])
        out_values[1, i] = sdf(table, p[0], p[1], p[2])
        out_values[2, i] = seam_zone(table, p[0], p[1], p[2])

    row = empty_rows(1)[0]
    row[SHAPES : SHAPES + SHAPE] = shape
    device = choose_device("cpu")
    out = wp.zeros((3, len(points)), dtype=float, device=device)
    wp.launch(
        forms_kernel,
        len(points),
        [wp.array(row, dtype=float, device=device), wp.array(points, dtype=wp.vec3, device=device)],
        [out],
        device=device,
    )
    return list(out.numpy())


@every_family
def test_starts_are_near_what_they_start_from(entry: Family) -> None:
    """A box gives a legal shape whose box is about as large."""
    size = np.array([[0.4, 0.5, 0.8], [0.9, 0.3, 0.3]])
    shapes, near = entry.starts(entry, box_solids(size))
    low, high = entry.fit_range
    assert near.shape == (2,)
    assert ((shapes >= low) & (shapes <= high)).all()
    for shape, extents in zip(shapes, size, strict=True):
        lower, upper = entry.bounds(shape)
        assert 0.3 < np.prod(upper - lower) / np.prod(extents) < 3.0


@every_family
def test_walls_and_straightened_shapes_fit_the_box(entry: Family, rng: np.random.Generator) -> None:
    for shape in random_shapes(entry, rng):
        low, high = entry.bounds(shape)
        if entry.walls is not None:
            assert entry.walls(shape).shape == (3,)
            assert (entry.walls(shape) <= (high - low).max() * (1.0 + 1e-5)).all()
        simpler = entry.straightened(shape)
        if simpler is None:
            continue
        # Points of the simpler surface come to lie on this one.
        points = around(entry, simpler[0], rng)
        on = np.abs(values(entry, simpler[0], points)) < 5e-3
        mapped = simpler[1](points[on]).astype(np.float32)
        assert np.quantile(np.abs(values(entry, shape, mapped)), 0.9) < 2e-2


@every_family
def test_a_mesh_in_closed_form_lies_on_the_surface(entry: Family, rng: np.random.Generator) -> None:
    if entry.mesh is None:
        return
    for shape in random_shapes(entry, rng, 4):
        vertices, faces = entry.mesh(shape)
        assert faces.max() < len(vertices)
        assert np.quantile(np.abs(values(entry, shape, vertices.astype(np.float32))), 0.95) < 1e-3


@pytest.mark.browser
@every_family
def test_a_page_computes_the_same(entry: Family, browser: Browser, rng: np.random.Generator) -> None:
    """Its box, and a step no longer than that of the field. That GLSL is Warp: test_glsl.py."""
    page = browser.new_page()
    for shape in random_shapes(entry, rng, 8):
        row = empty_rows(1)[0]
        row[SHAPES : SHAPES + SHAPE] = shape
        parameters = {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in Primitive.from_row(entry.name, "part", row).parameters.items()
        }
        found = page.evaluate(f"p => {{ const g = {entry.javascript}; return g.bounds(p); }}", parameters)
        np.testing.assert_allclose(found, entry.bounds(shape), atol=1e-5)
        text = f"p => {{ const g = {entry.javascript}; return g.stepping ? g.stepping(p) : {{}}; }}"
        stepping = page.evaluate(text, parameters)
        assert set(stepping) <= {"arc", "centre", "sign", "factor", "slack"}
        assert 0.0 < stepping.get("slack", 0.7) <= 1.0
        if entry.approximate:
            assert stepping["factor"] <= max(entry.step(shape), 0.08) + 1e-6
    page.close()
