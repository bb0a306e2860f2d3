"""Hostile assembly.json: wrong types, hostile names, extreme numbers, depth and size; and damaged ones."""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Iterator, Mapping
from typing import Any

from fuzz.damage import VALUES, damaged_bytes, holder, places_in
from fuzz.harness import Case

BOX: dict[str, Any] = {
    "family": "cuboid",
    "name": "a",
    "translation": [0.0, 0.0, 0.0],
    "rotation": [1.0, 0.0, 0.0, 0.0],
    "parameters": {"size": [0.5, 0.25, 0.75]},
    "blend": 0.0,
    "color": "#112233",
}
FRUSTUM: dict[str, Any] = {
    "family": "superfrustum",
    "name": "b",
    "translation": [0.3, 0.0, 0.0],
    "rotation": [1.0, 0.0, 0.0, 0.0],
    "parameters": {
        "size": [0.3, 0.3, 0.4], "roundness": 1.0, "dilation": 0.02, "taper": 0.5, "bulge": 0.0, "onion": -1.0,
    },
    "blend": 0.05,
    "color": "#445566",
}  # fmt: skip

RAW = (
    "NaN", "Infinity", "-Infinity", "1e400", "-0", "1E5", "0" * 10, "1" * 5000, "1e-400", '"\\ud800"', '"\\u0000"',
    "[" * 2000 + "]" * 2000, "/**/1", "01", "+1", ".5",
)  # fmt: skip
"""What a value is replaced by, as text that is no JSON or hardly."""

NAMES = (
    "</script><script>alert(1)</script>", "<img src=x onerror=alert(1)>", "<!--<script>", "]]>", "-->", "&lt;b&gt;",
    "a&b", "\"'`", "'; DROP TABLE", "../../../../tmp/evil", "/etc/passwd", "C:\\Windows\\x", "con", "nul.txt",
    "a/b\\c:d*e?f", ".", "..", "~", "-rf", "--help", "%n%s%x", "{{7*7}}", "${7*7}", "{{TITLE}}", "{{DATA}}", "$x$",
    "$\\frac{$", "\\", "a\\", "#", "# comment", "o x", "v 1 2 3", "f 1 2 3", "end_header", "é", "日本語", "\U0001f984",
    "א" * 20, "a" * 128, "e\u0301", "__proto__", "constructor", "toString", "null", "undefined", "0", "-1", "1e5",
    "NaN", "true", " a", "a ", "a  b", "<", ">", "&", '"', "'", "`", "=", ";", "//", "*/", "/*", "javascript:alert(1)",
    "\u00a0x", "\ufeffx", "x\u200d", "x\u202ey", "a\nb", "a\tb", "a\0b", "\u2028", "\u2029", "\ud800",
    "<svg/onload=alert(1)>", "<style>*{display:none}</style>", "?token=", "a" * 127 + "<", "ＡＢ", "ﷺ",
    "Z͑ͫ̓", "&#60;script&#62;", "\\u003cscript\\u003e", "</SCRIPT >", "</title><script>", "<base href=x>",
)  # fmt: skip


def document(
    *parts: Mapping[str, Any], scale: float = 1.0, shift: float = 0.0, **provenance: Any
) -> dict[str, Any]:
    """An assembly of parts, which it shares."""
    return {
        "format": "resfit-assembly",
        "version": 1,
        "transform": {"scale": scale, "translation": [shift, -shift, 0.0]},
        "primitives": [*parts],
        "provenance": provenance,
    }


def changed(part: Mapping[str, Any], **changes: Any) -> dict[str, Any]:
    """A part with other fields or parameters."""
    part = copy.deepcopy(dict(part))
    for key, value in changes.items():
        (part["parameters"] if key in part["parameters"] else part)[key] = value
    return part


GOOD = document(
    BOX,
    FRUSTUM,
    scale=2.0,
    shift=1.0,
    resfit="0.1.0",
    warp="1",
    seed=0,
    options={"preset": "fast"},
    input_sha256="0" * 64,
)


def text_of(value: Any) -> bytes:
    """JSON, lone surrogates as they are."""
    return json.dumps(value, ensure_ascii=False).encode("utf-8", "surrogatepass")


def document_cases() -> Iterator[Case]:
    """What every one of them is tried with."""
    text = text_of(GOOD)
    texts = {
        "good": text,
        "empty": b"",
        "utf-8 mark": b"\xef\xbb\xbf" + text,
        "utf-16": json.dumps(GOOD).encode("utf-16"),
        "latin-1": json.dumps(GOOD).replace('"a"', '"é"').encode("latin-1", "replace"),
        "deep list": b"[" * 200000 + b"]" * 200000,
        "deep object": b'{"a":' * 200000,
        "4000 digits": text.replace(b'"seed": 0', b'"seed": ' + b"9" * 4000),
        "5000 digits": text.replace(b'"seed": 0', b'"seed": ' + b"9" * 5000),
        "many options": text.replace(
            b'"preset": "fast"', ", ".join(f'"k{i}": {i}' for i in range(100000)).encode()
        ),
        "too large": text + b" " * (33 << 20),
        "list": b"[]",
        "number": b"7",
        "string": b'"resfit-assembly"',
    }
    for depth in (100, 200, 255, 256, 300, 500, 900, 985, 995, 2000, 50000):
        deep = b"[" * depth + b"]" * depth
        texts[f"options {depth} deep"] = text.replace(b'"fast"', deep)
        texts[f"parameters {depth} deep"] = text.replace(b"[0.5, 0.25, 0.75]", deep)
    for count in (0, 1, 1000, 1025, 20000, 20001, 100000):
        texts[f"{count} parts"] = text_of(document(*(changed(BOX, name=f"p{i}") for i in range(count))))
    texts["same name"] = text_of(document(BOX, changed(FRUSTUM, name="a")))
    script = "</script><script>alert(1)</script>"
    for key in ("resfit", "warp"):
        texts[f"provenance {key}"] = text_of({**GOOD, "provenance": {**GOOD["provenance"], key: script}})
    options = {"</script>": script, "x": "\u2028"}
    texts["provenance options"] = text_of({**GOOD, "provenance": {**GOOD["provenance"], "options": options}})
    for name, data in texts.items():
        yield Case(name, data, "json")
    for number, name in enumerate(NAMES):
        yield Case(
            f"name {number} {name[:20]!a}", text_of(document(changed(BOX, name=name), FRUSTUM)), "json"
        )


def number_cases() -> Iterator[Case]:
    """Valid assemblies of extreme scales, sizes and places."""
    for scale in (1.7e308, 1e300, 1e150, 1e39, 1e38, 1e20, 1e-20, 1e-38, 1e-40, 1e-300, 5e-324):
        for shift in (0.0, 1e300, -1.7e308):
            yield Case(
                f"scale {scale:g} {shift:g}",
                text_of(document(BOX, FRUSTUM, scale=scale, shift=shift)),
                "json",
            )
        yield Case(f"moved {scale:g}", text_of(document(BOX, shift=scale)), "json")
    for size in (0.0, 1e-45, 1e-20, 1e-6, 10.0, 999.0, 1e4, 1e15, 1e30, 3e38):
        made = {
            "size": document(changed(BOX, size=[size] * 3), FRUSTUM),
            "thin": document(changed(BOX, size=[0.5, 0.5, size])),
            "far": document(changed(BOX, translation=[size, -size, 0.0]), FRUSTUM),
            "blend": document(BOX, changed(FRUSTUM, blend=size)),
            "frustum": document(changed(FRUSTUM, size=[size] * 3)),
            "dilation": document(changed(FRUSTUM, dilation=size)),
        }
        for name, whole in made.items():
            yield Case(f"{name} {size:g}", text_of(whole), "json")


def mutated(rng: random.Random) -> tuple[str, bytes]:
    """(what was done, an assembly with it)."""
    whole = copy.deepcopy(GOOD)
    how = rng.choice(["value", "value", "value", "drop", "extra", "raw", "bytes", "number", "twice"])
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        path = rng.choice(places_in(whole))
        where = holder(whole, path)
        if how == "value":
            where[path[-1]] = copy.deepcopy(rng.choice(VALUES))
        elif how == "drop":
            del where[path[-1]]
        elif how == "extra" and isinstance(where, dict):
            where[rng.choice(["", "x", "__proto__", "a" * 1000, "name ", "Name", "é"])] = rng.choice(VALUES)
        elif how == "number" and isinstance(where[path[-1]], float):
            where[path[-1]] = rng.choice([-1, 1]) * 10.0 ** rng.uniform(-45, 39)
    if how == "raw":
        path = rng.choice(places_in(whole))
        holder(whole, path)[path[-1]] = "@@@"
        return how, text_of(whole).replace(b'"@@@"', rng.choice(RAW).encode())
    data = text_of(whole)
    if how == "bytes":
        return damaged_bytes(rng, data)
    if how == "twice":
        data = data.replace(b'"blend": 0.0', b'"blend": 0.0, "blend": 0.1', 1)
    return how, data
