"""assembly.json, version 1: read with one plain sentence per mistake, written as always the same bytes.

The models here check structure and types; what a value may be is checked where the value lives (`Primitive`,
`Transform`, `Assembly`), so that code and files meet the same rules and the same sentences.
"""

from __future__ import annotations

import json
from typing import Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from resfit.errors import AssemblyError

from .plain_json import DepthError, check_depth
from .primitive import shown

FORMAT: Final = "resfit-assembly"
VERSION: Final = 1

MAX_BYTES = 32 * 1024 * 1024
"""A primitive takes about 400 bytes: a larger file is something else, and is not read into memory."""

MAX_DEPTH = 64
"""Objects and lists within each other; options of a fit have five."""

MAX_PRIMITIVES = 20_000
"""Assemblies are compact by purpose; this many already take seconds a picture."""

Number = Annotated[float, Field(allow_inf_nan=False)]
Length = Annotated[float, Field(allow_inf_nan=False, ge=0.0)]
Vector3 = Annotated[list[Number], Field(min_length=3, max_length=3)]
Vector4 = Annotated[list[Number], Field(min_length=4, max_length=4)]


class Strict(BaseModel):
    """No conversion of types, no unknown fields."""

    model_config = ConfigDict(extra="forbid", strict=True)


class TransformDocument(Strict):
    """mesh = scale * normalised + translation."""

    scale: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    translation: Vector3


class PrimitiveDocument(Strict):
    """One primitive in the normalised frame; `rotation` is a unit quaternion (w, x, y, z), local to world."""

    family: str
    name: Annotated[str, Field(min_length=1, max_length=128)]
    translation: Vector3
    rotation: Vector4
    parameters: dict[str, Any]
    blend: Length
    color: Annotated[str, Field(json_schema_extra={"pattern": "^#[0-9a-fA-F]{6}$"})]


class ProvenanceDocument(Strict):
    """Where the assembly came from; may be empty."""

    resfit: str | None = None
    warp: str | None = None
    seed: int | None = None
    options: dict[str, Any] = {}
    input_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = None


class AssemblyDocument(Strict):
    """An assembly of analytic primitives; the smooth union folds left in list order."""

    format: Literal["resfit-assembly"]
    version: Literal[1]
    transform: TransformDocument
    primitives: Annotated[list[PrimitiveDocument], Field(max_length=MAX_PRIMITIVES)]
    provenance: ProvenanceDocument


def parse(content: bytes) -> AssemblyDocument:
    """The document in the bytes of an assembly.json.

    Raises:
        AssemblyError: one sentence that names the field, without the file's name.
    """
    data = _parse_json(content)
    if not isinstance(data, dict):
        raise AssemblyError("this is not an assembly: the top of the file must be a JSON object")
    if "format" not in data:
        raise AssemblyError(f'format is missing; an assembly has "format": "{FORMAT}"')
    if data["format"] != FORMAT:
        raise AssemblyError(f'format is {shown(data["format"])}; it must be "{FORMAT}"')
    # Before all other fields, because another version may have others.
    if "version" not in data:
        raise AssemblyError(f"version is missing; it must be {VERSION}")
    if type(data["version"]) is not int or data["version"] != VERSION:
        raise AssemblyError(f"version is {shown(data['version'])}; this release reads version {VERSION}")
    primitives = data.get("primitives")
    if isinstance(primitives, list) and len(primitives) > MAX_PRIMITIVES:
        raise AssemblyError(f"primitives has {len(primitives)} entries; at most {MAX_PRIMITIVES} are read")
    try:
        return AssemblyDocument.model_validate(data)
    except ValidationError as error:
        raise AssemblyError(_sentence(error)) from None


def _parse_json(content: bytes) -> Any:
    if len(content) > MAX_BYTES:
        raise AssemblyError(f"this is not an assembly: the file is larger than {MAX_BYTES >> 20} MiB")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise AssemblyError("this is not an assembly: the file is not text in UTF-8") from None
    if not text.strip():
        raise AssemblyError("this is not an assembly: the file is empty")
    try:
        data = json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_unique)
        check_depth(data, MAX_DEPTH)
        return data
    except json.JSONDecodeError as error:
        raise AssemblyError(
            f"this is not JSON: {error.msg.lower()} at line {error.lineno}, column {error.colno}"
        ) from None
    except (RecursionError, DepthError):
        raise AssemblyError("this is not an assembly: the JSON is nested too deeply") from None
    except ValueError:
        # What else json lets through: whole numbers of thousands of digits.
        raise AssemblyError("this is not an assembly: a number has too many digits") from None


def _refuse_constant(name: str) -> Any:
    raise AssemblyError(f"the file has the number {name}; JSON knows only finite numbers")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise AssemblyError(f"the field {shown(key)} stands twice in one object")
        found[key] = value
    return found


def _sentence(error: ValidationError) -> str:
    """The first of pydantic's errors as one plain sentence."""
    first = error.errors(include_url=False)[0]
    place, value, kind = _place(first["loc"]), first["input"], first["type"]
    limits = first.get("ctx", {})
    sentences = {
        "missing": f"{place} is missing",
        "extra_forbidden": f"{place} is not a known field",
        "model_type": f"{place} is {shown(value)}; it must be an object",
        "dict_type": f"{place} is {shown(value)}; it must be an object",
        "list_type": f"{place} is {shown(value)}; it must be a list",
        "float_type": f"{place} is {shown(value)}; it must be a number",
        "int_type": f"{place} is {shown(value)}; it must be a whole number",
        "string_type": f"{place} is {shown(value)}; it must be text",
        "finite_number": f"{place} must be a finite number",
        "greater_than": f"{place} is {shown(value)}; it must be above {limits.get('gt', 0):g}",
        "greater_than_equal": f"{place} is {shown(value)}; it must be {limits.get('ge', 0):g} or more",
        "string_too_short": f"{place} is empty",
        "string_too_long": f"{place} is longer than {limits.get('max_length')} characters",
        "string_pattern_mismatch": f"{place} is {shown(value)}; it must match {limits.get('pattern')}",
        "string_unicode": f"{place} has characters that are not Unicode text",
    }
    if kind in ("too_short", "too_long"):
        count = limits.get("min_length", limits.get("max_length"))
        return f"{place} has {limits.get('actual_length')} values; it must have {count}"
    return sentences.get(kind, f"{place} is {shown(value)}, which is not valid")


def _place(location: tuple[int | str, ...]) -> str:
    """`primitives[3].parameters.taper` of a location; names that are no identifiers are quoted."""
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
        elif part.isidentifier() and part.isascii() and len(part) <= 60:
            text += f".{part}"
        else:
            text += f"[{shown(part)}]"
    return text.removeprefix(".") or "the file"


def format_document(document: AssemblyDocument) -> bytes:
    """The bytes of an assembly.json: one line a primitive, for differences that read well."""
    data = document.model_dump()
    provenance = {key: value for key, value in data["provenance"].items() if value not in (None, {})}
    lines = [_line(primitive) for primitive in data["primitives"]]
    primitives = "[\n    " + ",\n    ".join(lines) + "\n  ]" if lines else "[]"
    fields = {
        "format": json.dumps(document.format),
        "version": json.dumps(document.version),
        "transform": _line(data["transform"]),
        "primitives": primitives,
        # Sorted, because options are the same options in any order.
        "provenance": json.dumps(provenance, sort_keys=True, allow_nan=False),
    }
    text = ",\n".join(f'  "{name}": {value}' for name, value in fields.items())
    return f"{{\n{text}\n}}\n".encode()


def _line(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)
