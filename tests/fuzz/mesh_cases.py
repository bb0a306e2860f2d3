"""Hostile STL, PLY, OFF and OBJ files: numbers out of range, headers that lie, odd text, and shapes that hurt."""

from __future__ import annotations

import math
import random
import struct
from collections.abc import Iterator

from fuzz.harness import Case
from fuzz.samples import CORNERS, FACES, OBJ_FACES, PLY_BODY, PLY_TEXT, obj, off, ply, stl, tetrahedron

NUMBERS = (
    "nan", "inf", "-inf", "1e38", "1e39", "1e150", "1e160", "1e200", "1e300", "1.7e308", "1e400", "1e-38", "1e-45",
    "1e-150", "1e-160", "1e-200", "1e-300", "5e-324", "0x10", "1_0", "1,5", "--1", "\u0661",
)  # fmt: skip

COUNTS = (-1, 0, 3, 5, 10**7, 2**31, 2**32, 2**40, 2**63, 10**30)


def number_cases() -> Iterator[Case]:
    """Coordinates that are no numbers, too large, too small or far away."""
    for value in NUMBERS:
        points = [(0, 0, 0), (value, 0, 0), (0, value, 0), (0, 0, value)]
        yield Case(f"scaled {value}", obj(points), "obj")
        mixed = [*CORNERS, (value, 1, 1)]
        yield Case(f"one {value}", obj(mixed, [*OBJ_FACES, (1, 2, 5)]), "obj")
        yield Case(f"unused {value}", obj(mixed), "obj")
        yield Case(f"off {value}", off(points), "off")
    for value in (math.nan, math.inf, 3e38, 1e38, 1e-38, 1e-45, 1e20, 1e-20):
        yield Case(f"stl {value:g}", stl(tetrahedron(value)), "stl")
        first, *rest = tetrahedron()
        yield Case(f"stl one {value:g}", stl([(value, *first[1:]), *rest]), "stl")
    for shift in (1e3, 1e5, 1e6, 1e7, 1e8):
        yield Case(f"stl far {shift:g}", stl(tetrahedron(1.0, shift)), "stl")
    for shift in (1e3, 1e6, 1e8, 1e12, 1e15, 1e16, 1e17):
        points = [tuple(value + shift for value in corner) for corner in CORNERS]
        yield Case(f"obj far {shift:g}", obj(points), "obj")


def shape_cases() -> Iterator[Case]:
    """Triangles without area or neighbours, needles, and meshes where everything meets everything."""
    good = tetrahedron()
    yield Case("point", stl([(1, 1, 1) * 3] * 20), "stl")
    yield Case("line", stl([(0, 0, 0, 1, 0, 0, 2, 0, 0)] * 20), "stl")
    yield Case("one face", stl(good[:1]), "stl")
    yield Case("same faces", stl(good * 200), "stl")
    yield Case("both sides", stl([*good, *(face[3:6] + face[0:3] + face[6:9] for face in good)]), "stl")
    yield Case("needle", stl([*good, (0, 0, 0, 1e7, 0, 0, 1e7, 1e-7, 0)]), "stl")
    yield Case("speck", stl([*good, *tetrahedron(1e-3, 400.0)]), "stl")
    yield Case("slivers", stl([(0, 0, 0, 1, 0, 0, 0.5, 1e-7 * i, 0) for i in range(200)]), "stl")
    yield Case("plane", obj([(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0)], [(1, 2, 3), (2, 4, 3)]), "obj")
    yield Case("thin triangle", obj([(0, 0, 0), (1, 0, 0), (0, 1e-6, 0)], [(1, 2, 3)]), "obj")
    rng = random.Random(5)

    def numbers(count: int) -> tuple[float, ...]:
        return tuple(rng.uniform(-1, 1) for _ in range(count))

    yield Case("soup", stl([numbers(9) for _ in range(3000)]), "stl")
    yield Case("star of a shared vertex", stl([(0, 0, 0, *numbers(6)) for _ in range(2000)]), "stl")
    yield Case(
        "book of a shared edge", stl([(0, 0, 0, 0, 0, 1, *numbers(2), 0.5) for _ in range(2000)]), "stl"
    )


def header_cases() -> Iterator[Case]:
    """STL, PLY and OFF files whose headers claim what is not there."""
    good = tetrahedron()
    for count in (0, 3, 5, 10**7, 0xFFFFFFFF):
        yield Case(f"stl claims {count}", stl(good, count), "stl")
    yield Case("stl header only", stl([]), "stl")
    begin = b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
    yield Case("ascii stl cut", begin, "stl")
    yield Case("ascii stl of two vertices", begin + b"endloop\nendfacet\nendsolid a\n", "stl")
    yield Case("ascii stl of many solids", b"solid\nendsolid\n" * 20000, "stl")
    yield Case("ascii stl of words", b"solid a\n" + b"vertex a b c\n" * 3000, "stl")
    for count in COUNTS:
        for binary, body, kind in (
            ("", PLY_BODY, "binary_little_endian"),
            (" ascii", PLY_TEXT.encode(), "ascii"),
        ):
            yield Case(f"ply{binary} claims {count} vertices", ply(body, vertices=count, kind=kind), "ply")
            yield Case(f"ply{binary} claims {count} faces", ply(body, faces=count, kind=kind), "ply")
        yield Case(f"off claims {count} vertices", f"OFF\n{count} 4 0\n{PLY_TEXT}".encode(), "off")
        yield Case(f"off claims {count} faces", f"OFF\n4 {count} 0\n{PLY_TEXT}".encode(), "off")
    for index in (-1, 4, 2**31 - 1, -(2**31)):
        yield Case(f"ply index {index}", ply(PLY_BODY[:-4] + struct.pack("<i", index)), "ply")
        yield Case(f"off index {index}", off(CORNERS, [*FACES[:3], (0, 1, index)]), "off")
    for count in (-3, 99999999999):
        yield Case(
            f"off polygon of {count}",
            off(CORNERS, []).replace(b" 0 0\n", b" 1 0\n", 1) + b"%d 0 1 2\n" % count,
            "off",
        )
    circle = [(i, i * i % 97, i % 7) for i in range(30000)]
    yield Case("off large polygon", off(circle, [range(30000)]), "off")
    yield Case("off repeated", b"OFF" * 100000, "off")
    yield from ply_header_cases()


def ply_header_cases() -> Iterator[Case]:
    """PLY files whose properties are not those of a mesh."""
    for kind, content in (("uint", struct.pack("<I", 0xFFFFFFFF)), ("int", struct.pack("<i", -5))):
        body = PLY_BODY[:48] + content + bytes(64)
        yield Case(f"ply list {kind}", ply(body, face=f"property list {kind} int vertex_indices\n"), "ply")
    for face in ("property list float int vertex_indices\n", "property list uchar quad vertex_indices\n", ""):
        yield Case(f"ply face {face[14:24]}", ply(face=face), "ply")
    for vertex in (
        "property list uchar float x\nproperty float y\nproperty float z\n",
        "property float x\n" * 3,
        "property float x\nproperty float y\n",
        "".join(f"property float p{i}\n" for i in range(20000)),
    ):
        yield Case(f"ply vertex {len(vertex)}", ply(vertex=vertex), "ply")
    yield Case("ply of the other end", ply(kind="binary_big_endian"), "ply")
    yield Case(
        "ply of many elements", b"ply\nformat ascii 1.0\n" + b"element a 0\n" * 50000 + b"end_header\n", "ply"
    )
    yield Case("ply without an end", ply().replace(b"end_header\n", b""), "ply")
    yield Case(
        "ply long header", b"ply\nformat ascii 1.0\n" + b"comment x\n" * 300000 + b"end_header\n", "ply"
    )
    texture = b"comment TextureFile ../../../../etc/passwd\nelement vertex"
    yield Case("ply texture elsewhere", ply().replace(b"element vertex", texture, 1), "ply")


def obj_cases() -> Iterator[Case]:
    """OBJ files with odd indices, lines and encodings."""
    good = obj(CORNERS)
    yield Case("obj without faces", obj(CORNERS, []), "obj")
    corners = (
        "0",
        "-1",
        "-99",
        "5",
        "9" * 20,
        "1.5",
        "a",
        "1/1/1",
        "1//",
        "//",
        "1/2/3/4/5",
        "2147483648",
        "",
    )
    for corner in corners:
        yield Case(f"obj corner '{corner}'", obj(CORNERS, [*OBJ_FACES, (1, 2, corner)]), "obj")
    for count in (5, 1000, 30000, 200000):
        angles = [2.0 * math.pi * i / count for i in range(count)]
        points = [(math.cos(a), math.sin(a), 0.1 * (i % 3)) for i, a in enumerate(angles)]
        yield Case(f"obj polygon of {count}", obj(points, [range(1, count + 1)]), "obj")
    yield Case("obj polygon of the same", obj(CORNERS, [[1, 2, 3] * 30000]), "obj")
    yield Case("obj mixed polygons", obj(CORNERS * 25, [range(1, 3 + i % 90) for i in range(3000)]), "obj")
    yield Case("obj faces of one corner", obj(CORNERS, [(1,)] * 1000), "obj")
    yield Case("obj faces of two corners", obj(CORNERS, [(1, 2)] * 1000), "obj")
    lines = (
        "mtllib ../../../../etc/passwd", "mtllib /dev/zero", "mtllib http://127.0.0.1:9/x", "mtllib \0", "usemtl x",
        "o </script>", "o \u202e", "g " + "g" * 100000, "s off", "call /bin/sh", "csh rm", "v", "v 1",
        "v 1 2 3 4 5 6 7 8", "vt 1", "vn x", "f", "l 1 2", "p 1", "\\", "#" * 100000,
    )  # fmt: skip
    for line in lines:
        yield Case(f"obj line {line[:20]!a}", line.encode() + b"\n" + good, "obj")
    groups = b"".join(b"g a%d\nusemtl m%d\nf 1 2 3\n" % (i, i) for i in range(20000))
    yield Case("obj of 20000 groups", good + groups, "obj")
    objects = b"".join(
        b"o a%d\nv 0 0 %d\nv 1 0 %d\nv 0 1 %d\nf -1 -2 -3\n" % (i, i, i, i) for i in range(20000)
    )
    yield Case("obj of 20000 objects", objects, "obj")
    yield Case("obj long line", b"v " + b"1 " * 500000 + b"\n" + good, "obj")
    yield Case("obj utf-16", good.decode().encode("utf-16"), "obj")
    yield Case("obj utf-8 mark", b"\xef\xbb\xbf" + good, "obj")
    yield Case("obj of carriage returns", good.replace(b"\n", b"\r"), "obj")
    yield Case("obj of zero bytes", good.replace(b" ", b"\0"), "obj")
    yield Case("obj continued lines", good.replace(b"f 1 3 2", b"f 1 \\\n3 \\\n2"), "obj")
    yield Case("obj comment inside", good.replace(b"f 1 3 2", b"f 1 3 2 # x"), "obj")


def other_cases() -> Iterator[Case]:
    """Files that are no meshes."""
    magic = {
        "glb": b"glTF", "gltf": b"{", "obj": b"v", "ply": b"ply\n", "stl": b"solid", "off": b"OFF", "zip": b"PK\3\4",
        "bz2": b"BZh9", "dxf": b"0\nSECTION", "xyz": b"1", "3mf": b"PK\3\4", "gz": b"\x1f\x8b",
    }  # fmt: skip
    html = b"<!doctype html><html><body>404</body></html>"
    for suffix, first in magic.items():
        yield Case(f"random {suffix}", random.Random(suffix).randbytes(777), suffix)
        yield Case(f"magic only {suffix}", first, suffix)
        yield Case(f"magic and noise {suffix}", first + random.Random(suffix).randbytes(777), suffix)
        yield Case(f"zeros {suffix}", bytes(1000), suffix)
        yield Case(f"page {suffix}", html, suffix)
        yield Case(f"empty {suffix}", b"", suffix)
    yield Case(
        "pointer of git lfs", b"version https://git-lfs.github.com/spec/v1\noid sha256:abc\nsize 12\n", "stl"
    )
    yield Case("xyz points", b"0 0 0\n1 0 0\n0 1 0\n" * 100, "xyz")
    yield Case("xyz words", b"a b c\n" * 1000, "xyz")
    yield Case(
        "dxf circle", b"0\nSECTION\n2\nENTITIES\n0\nCIRCLE\n10\n0\n20\n0\n40\n1\n0\nENDSEC\n0\nEOF\n", "dxf"
    )


def file_cases() -> Iterator[Case]:
    """All of the above."""
    yield from number_cases()
    yield from shape_cases()
    yield from header_cases()
    yield from obj_cases()
    yield from other_cases()
