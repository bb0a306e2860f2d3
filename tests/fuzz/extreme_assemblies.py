"""Extreme assemblies: valid ones through picture, evaluation, worth of parts, --init, full-size exports and distances.

Extreme sizes, places, blends and scales, many parts, odd names. Wrong: numbers that are not finite in what is said of
them, besides None.
"""

from __future__ import annotations

import json
import random
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fuzz.assembly_cases import BOX, FRUSTUM, changed, document, number_cases, text_of
from fuzz.campaigns import shuffled
from fuzz.harness import Campaign, Case, Wrong

if TYPE_CHECKING:
    import trimesh

    from resfit import Assembly

SHAPES = {
    "roundness": (0.0, 1.0),
    "taper": (-1.0, 0.0, 1.0, 2.0),
    "bulge": (-1.0, -0.999, 0.999, 1.0, 3.0),
    "onion": (-1.0, 0.0, 1e-9, 1.0, 100.0),
}


def wholes() -> Iterator[Case]:
    """The assemblies."""
    yield from number_cases()
    yield Case("plain", text_of(document(BOX, FRUSTUM)))
    yield Case("empty", text_of(document()))
    for name, values in SHAPES.items():
        for value in values:
            yield Case(f"{name} {value:g}", text_of(document(changed(FRUSTUM, **{name: value}))))
    many = [
        changed(BOX, name=f"p{i}", translation=[0.01 * (i % 100), 0.02 * (i // 100), 0.0], size=[0.004] * 3)
        for i in range(1500)
    ]
    yield Case("many", text_of(document(*many)))
    yield Case("all the same", text_of(document(*(changed(FRUSTUM, name=f"p{i}") for i in range(300)))))
    for name in (
        "$x$",
        "$\\frac{$",
        "$$",
        "%",
        "\\",
        "</script>",
        "a" * 128,
        "日本語",
        "\U0001f984",
        "__proto__",
    ):
        yield Case(f"name {name[:10]!a}", text_of(document(changed(BOX, name=name), FRUSTUM)))


def cases(rng: random.Random) -> Iterator[Case]:
    """Each assembly with each use."""
    pairs = [Case(f"{use}: {case.name}", case.data, "json") for case in wholes() for use in USES]
    return shuffled(rng, pairs)


def attempt(case: Case, folder: Path) -> None:
    """One use of one assembly."""
    from resfit import Assembly

    path = folder / "assembly.json"
    path.write_bytes(case.data)
    USES[case.name.partition(":")[0]](path, Assembly.load(path))


@cache
def ball() -> trimesh.Trimesh:
    """What assemblies are scored against."""
    import trimesh

    return trimesh.creation.icosphere(subdivisions=2)


def picture(path: Path, _: Assembly) -> None:
    """As `resfit view --screenshot` draws it."""
    from resfit.viewer.open_view import save_screenshot
    from resfit.viewer.scene.opengl_check import prepare
    from resfit.viewer.scene.request import Request

    prepare(True)
    save_screenshot(Request([path], show=["labels"], size=(320, 240)), path.with_name("p.png"))


def scored(path: Path, **options: Any) -> None:
    """As `resfit eval` scores it."""
    import resfit

    scores = resfit.evaluate(path, ball(), emd=False, device="cpu", **options)
    try:
        json.dumps(scores, allow_nan=False)
    except ValueError:
        raise Wrong(f"scores are not finite: {scores}") from None


def worth(_: Path, whole: Assembly) -> None:
    """What each part adds."""
    from resfit.assembly.worth import part_worths

    part_worths(whole)


def init(path: Path, whole: Assembly) -> None:
    """A fit that starts from it."""
    import resfit

    result = resfit.fit(ball(), preset="fast", rounds=1, max_primitives=4, init=whole, device="cpu")
    result.save(path.with_name("fit"))


def exported(path: Path, whole: Assembly) -> None:
    """Each format, at the size that is usual."""
    import resfit

    for name, options in (("x.glb", {}), ("x.obj", {"merged": True}), ("x.stl", {})):
        resfit.export(whole, path.with_name(name), device="cpu", **options)


def distances(_: Path, whole: Assembly) -> None:
    """The field at points far away and none."""
    whole.sdf([[0.0, 0.0, 0.0], [1e300, 0.0, 0.0], [float("nan")] * 3])


USES: dict[str, Callable[[Path, Assembly], None]] = {
    "picture": picture,
    "eval": lambda path, _: scored(path),
    "eval by box": lambda path, _: scored(path, align="bbox"),
    "worth": worth,
    "init": init,
    "export": exported,
    "distances": distances,
}

CAMPAIGN = Campaign("extreme-assemblies", cases, attempt, hang_s=60.0)
