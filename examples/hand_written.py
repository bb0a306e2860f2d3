"""A desk lamp of twelve hand-written primitives: loaded, measured, exported and rendered.

    .venv/bin/python examples/hand_written.py [FOLDER]

Writes desk_lamp.glb, with one named object a part, and desk_lamp.png.
"""

from __future__ import annotations

import sys
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np
from PIL import Image

import resfit
from resfit.assembly.colors import rgb
from resfit.kernels.contour.isosurface import tight_bounds
from resfit.kernels.render.camera import frame_bounds
from resfit.kernels.render.raytrace import render_assembly


def main(folder: Path) -> None:
    """Write the lamp's files to `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    with as_file(files("resfit.data") / "desk_lamp.json") as path:
        lamp = resfit.Assembly.load(path)

    below_shade = lamp.transform.to_mesh([[0.6, 0.0, -0.3]])
    distance = lamp.sdf(below_shade)[0]
    sys.stdout.write(f"{len(lamp.primitives)} primitives; a point {distance:.1f} mm from the lamp\n")

    resfit.export(lamp, folder / "desk_lamp.glb")
    colors = np.array([rgb(primitive.color) for primitive in lamp.primitives])
    primitives = lamp.on_device()
    camera = frame_bounds(*tight_bounds(primitives), up="z", azimuth=25.0, elevation=14.0)
    image = render_assembly(primitives, colors, camera, 960, 720)
    Image.fromarray(image).save(folder / "desk_lamp.png")
    sys.stdout.write(f"wrote {folder / 'desk_lamp.glb'} and {folder / 'desk_lamp.png'}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("out/demo"))
