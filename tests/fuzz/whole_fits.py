"""Whole fits: the nastier meshes by `resfit fit`.

Wrong: any end but exit code 0 with a whole result, or 2 with nothing written and one line; more than 2 GB; files left.
"""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from pathlib import Path

from fuzz.archive_cases import archive_cases
from fuzz.campaigns import shuffled
from fuzz.commands import check_code, check_folder, fit_command, run
from fuzz.gltf_cases import gltf_cases
from fuzz.harness import Campaign, Case, Wrong
from fuzz.mesh_cases import file_cases
from resfit.errors import InputError

CHOSEN = (
    "scaled 1e38", "scaled 1e150", "scaled 1e160", "scaled 1e300", "scaled 1e-38", "scaled 1e-150", "scaled 5e-324",
    "one nan", "one 1e150", "unused inf", "stl far 1e+06", "obj far 1e+15", "obj far 1e+16", "stl 3e+38", "stl 1e-45",
    "needle", "speck", "slivers", "plane", "thin triangle", "soup", "star of a shared vertex", "book of a shared edge",
    "one face", "both sides", "same faces", "obj polygon of 30000", "obj of 20000 groups",
    "ply claims 10000000 vertices", "gltf node name 5", "gltf node name 6", "gltf node name 7", "gltf node name 8",
    "gltf 3000 meshes", "gltf node matrix 2", "gltf node scale 1", "gltf node scale 2", "gltf node scale 3",
    "gltf bare 0 5", "gltf bare 1 300000000", "gltf chain of 100000", "gltf flat 100000", "zip to elsewhere",
    "zip bomb a.stl", "bz2 bomb",
)  # fmt: skip

MOST_MB = 2000.0


def many_bodies() -> Iterator[Case]:
    """Thousands of separate boxes, as bodies of one mesh and as nodes of a scene."""
    import numpy as np
    import trimesh

    rng = np.random.default_rng(0)

    def boxes(number: int, alike: bool) -> Iterator[trimesh.Trimesh]:
        for i in range(number):
            box = trimesh.creation.box((0.5,) * 3 if alike else rng.uniform(0.2, 0.8, 3))
            yield box.apply_translation((i % 20, i // 20 % 20, i // 400))

    for alike in (False, True):
        whole = trimesh.util.concatenate(list(boxes(3000, alike)))
        yield Case(f"3000 {'same ' if alike else ''}bodies", bytes(whole.export(file_type="stl")), "stl")
    scene = trimesh.Scene()
    for i, box in enumerate(boxes(2000, False)):
        scene.add_geometry(box, node_name=f"node {i}", geom_name=f"g{i}")
    yield Case("2000 nodes", bytes(scene.export(file_type="glb")), "glb")


def cases(rng: random.Random) -> Iterator[Case]:
    """Those chosen from the mesh files, and scenes of many bodies."""
    found = {case.name: case for case in (*file_cases(), *gltf_cases(), *archive_cases())}
    return shuffled(rng, [*(found[name] for name in CHOSEN), *many_bodies()])


def attempt(case: Case, folder: Path) -> str:
    """Fit one, and look at what is there."""
    mesh, out = folder / f"m.{case.suffix}", folder / "out"
    mesh.write_bytes(case.data)
    done = run(fit_command(mesh, out), folder)
    check_code(done, (0, 2))
    check_folder(done, out)
    others = sorted(path.name for path in folder.iterdir() if path not in (mesh, out))
    if others:
        raise Wrong(f"it left {others}")
    if done.code == 2:
        if out.exists() or done.out or done.err.count("\n") != 1:
            raise Wrong(f"refused, but with {done.err.count(chr(10))} lines, or with a result: {done.tail}")
        raise InputError(done.err)
    found = json.loads((out / "report.json").read_text())["metrics"]
    if found["peak_mb"] > MOST_MB:
        raise Wrong(f"the fit took {found['peak_mb']:.0f} MB")
    return f"IoU {found['iou']}, {found['primitive_count']} parts"


CAMPAIGN = Campaign("whole-fits", cases, attempt, hang_s=120.0)
