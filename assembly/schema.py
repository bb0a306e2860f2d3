"""The JSON Schema of assembly.json, made from the document's models and the families' parameter tables.

`python -m resfit.assembly.schema FILE` writes it; a test keeps the shipped `assembly.schema.json` up to date.
"""

from __future__ import annotations

import copy
import json
import math
import sys
from pathlib import Path
from typing import Any

from ..kernels.primitives import FAMILIES, Family, Parameter
from .atomic_write import write_bytes
from .document import AssemblyDocument

SCHEMA_PATH = Path(__file__).with_name("assembly.schema.json")
"""Where the shipped schema lies."""


def assembly_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of an assembly.json, with the legal range of every parameter."""
    schema = _without_titles(AssemblyDocument.model_json_schema())
    definitions = schema["$defs"]
    generic = definitions.pop("PrimitiveDocument")
    for family in FAMILIES.values():
        definitions[family.name] = _family_schema(family, generic)
    schema["properties"]["primitives"]["items"] = {
        "oneOf": [{"$ref": f"#/$defs/{name}"} for name in FAMILIES],
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "resfit assembly, version 1",
        **schema,
    }


def schema_bytes() -> bytes:
    """The schema as the bytes of its file."""
    return (json.dumps(assembly_schema(), indent=2) + "\n").encode()


def _family_schema(family: Family, generic: dict[str, Any]) -> dict[str, Any]:
    schema = copy.deepcopy(generic)
    schema["description"] = family.description
    schema["properties"]["family"] = {"const": family.name}
    schema["properties"]["parameters"] = {
        "type": "object",
        "properties": {parameter.name: _parameter_schema(parameter) for parameter in family.parameters},
        "required": [parameter.name for parameter in family.parameters],
        "additionalProperties": False,
    }
    return schema


def _parameter_schema(parameter: Parameter) -> dict[str, Any]:
    number: dict[str, Any] = {"type": "number"}
    low, high = parameter.legal
    if math.isfinite(low):
        number["minimum"] = low
    if math.isfinite(high):
        number["maximum"] = high
    text = {"description": f"{parameter.description} ({parameter.unit})"}
    if parameter.count == 1:
        return text | number
    return text | {"type": "array", "items": number, "minItems": parameter.count, "maxItems": parameter.count}


def _without_titles(schema: Any) -> Any:
    """`schema` without the titles that pydantic derives from names: they repeat the names."""
    if isinstance(schema, list):
        return [_without_titles(entry) for entry in schema]
    if isinstance(schema, dict):
        return {
            key: _without_titles(value)
            for key, value in schema.items()
            if not (key == "title" and isinstance(value, str))
        }
    return schema


def main() -> None:
    """Write the schema to the file named on the command line, or to stdout."""
    if len(sys.argv) > 1:
        write_bytes(sys.argv[1], schema_bytes())
    else:
        sys.stdout.write(schema_bytes().decode())


if __name__ == "__main__":
    main()
