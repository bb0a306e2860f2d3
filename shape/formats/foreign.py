"""Kinds of files that are no meshes or are not read, and what to do with each."""

from __future__ import annotations

from pathlib import Path

from resfit.errors import InputError

_SURFACE = "make a surface of it first, for instance by Poisson reconstruction in MeshLab"
_GLB = "open it in Blender or in the program that wrote it, and export GLB"
_STL = "open it in a CAD program, for instance FreeCAD, and export STL"

_KINDS = (
    ("step stp iges igs brep sat sab x_t x_b sldprt sldasm ipt iam catpart catproduct f3d 3dm fcstd jt ifc",
     "is a CAD model and not a mesh", _STL),
    ("fbx blend dae 3ds max ma mb c4d lwo lxo skp usd usda usdc usdz x abc wrl vrml x3d 3dxml xaml amf ctm zae",
     "is of a format that is not read here", _GLB),
    ("drc", "is compressed by Draco alone", "decode it to PLY or OBJ with draco_decoder"),
    ("xyz pts pcd las laz e57 asc", "is a point cloud without faces", _SURFACE),
    ("dxf dwg svg", "is a drawing", "export the surface of the shape as STL or OBJ"),
    ("vtk vtu vtp msh inp nas bdf med", "is a mesh for simulation", "export its surface as STL or PLY, from ParaView"),
    ("gcode", "is machine code", "give the mesh from which it was made"),
    ("bin", "holds only numbers, which a glTF file describes", "give the .gltf file beside it"),
    ("mtl", "holds only materials", "give the .obj file beside it"),
    ("png jpg jpeg gif bmp tif tiff webp pdf", "is a picture or document", "give a mesh"),
    ("7z rar xz zst", "is packed by a method that is not read here", "unpack it and give the mesh in it"),
    ("html", "is a page of HTML and not the mesh", "download the file itself"),
    ("lfs", "is a Git LFS pointer and not the file itself", "fetch it by 'git lfs pull'"),
)  # fmt: skip

FOREIGN = {kind: (what, way) for kinds, what, way in _KINDS for kind in kinds.split()}
"""Suffix or name of a kind: what a file of it is, and what to do."""


def refusal(path: Path, kind: str) -> InputError:
    """The sentence about a file of a kind in FOREIGN."""
    what, way = FOREIGN[kind]
    return InputError(f"'{path}' {what}; {way}.")
