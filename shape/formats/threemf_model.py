"""A model part of a 3MF package: its objects and what it builds, read from XML."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np
import numpy.typing as npt

from resfit.errors import InputError

from .unpacking import Stream

CHUNK = 1 << 20
PATH = "http://schemas.microsoft.com/3dmanufacturing/production/2015/06 path"
"""The attribute that names another model part, as expat writes it."""
SHAPES = {
    "beamlattice": "a beam lattice",
    "slicestack": "slices",
    "levelset": "an implicit shape",
    "implicitfunction": "an implicit shape",
    "volumedata": "volumetric data",
    "booleans": "a Boolean operation",
    "booleanshape": "a Boolean operation",
    "displacementmesh": "displacements",
}
"""Elements that describe shape otherwise than by triangles, and what messages call them."""

FAMILIAR = (
    "production", "material", "beamlattice", "slice", "boolean", "displacement", "volumetric", "implicit",
)  # fmt: skip
"""Words in the namespaces of extensions that are read, change no shape, or have elements in SHAPES."""

UNITS = ("micron", "millimeter", "centimeter", "inch", "foot", "meter")

Matrix = npt.NDArray[np.float64]
"""(4, 3): a row vector times its first three rows, plus its last one."""


@dataclass(frozen=True)
class Use:
    """A component or build item: an object and where it is placed."""

    part: str
    """The model part in which the object is; empty for the one that this stands in."""
    object_id: str
    matrix: Matrix | None
    name: str


@dataclass
class Object:
    """A mesh or an assembly of components."""

    name: str
    kind: str
    """model, solidsupport, support, surface or other."""
    coordinates: array[float] = field(default_factory=lambda: array("d"))
    corners: array[int] = field(default_factory=lambda: array("q"))
    components: list[Use] = field(default_factory=list)

    @property
    def face_count(self) -> int:
        return len(self.corners) // 3


@dataclass
class Model:
    """Contents of a model part."""

    unit: str = "millimeter"
    objects: dict[str, Object] = field(default_factory=dict)
    items: list[Use] = field(default_factory=list)
    shapes: dict[str, None] = field(default_factory=dict)
    """What else than triangles describes shape, in words."""


def read_model(stream: Stream, name: str) -> Model:
    """The objects and build items of a model part.

    Args:
        stream: its XML.
        name: what messages call it.

    Raises:
        InputError: if it is damaged, or declares a document type (3MF forbids it: entities could fill the memory).
    """
    reader = _ModelReader(name)
    try:
        while chunk := stream.read(CHUNK):
            reader.parser.Parse(chunk, False)
        reader.parser.Parse(b"", True)
    except (expat.ExpatError, ValueError, LookupError, OverflowError) as error:
        line = reader.parser.CurrentLineNumber
        raise InputError(
            f"the 3D model in {name} is damaged in line {line}; export or download it again."
        ) from error
    return reader.model


class _ModelReader:
    """Handlers of expat, with what they have found."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.model = Model()
        self.object: Object | None = None
        self.parser = expat.ParserCreate(namespace_separator=" ")
        self.parser.StartElementHandler = self._start
        self.parser.StartDoctypeDeclHandler = self._refuse_doctype
        self.parser.StartNamespaceDeclHandler = self._declare
        self.namespaces: dict[str, str] = {}
        # Bytes of one model part come in one encoding; the arrays below hold what is kept.
        self.parser.buffer_text = True
        self._handlers: dict[str, Callable[[dict[str, str]], None]] = {}

    def _declare(self, prefix: str | None, uri: str | None) -> None:
        self.namespaces[prefix or ""] = uri or ""

    def _refuse_doctype(self, *_: object) -> None:
        raise InputError(f"the 3D model in {self.name} declares a document type, which 3MF forbids.")

    def _start(self, tag: str, attributes: dict[str, str]) -> None:
        handler = self._handlers.get(tag)
        if handler is None:
            local = tag.rpartition(" ")[2]
            if local in SHAPES:
                self.model.shapes[SHAPES[local]] = None
            handler = getattr(self, f"_on_{local}", None) if local.isascii() and local.isalpha() else None
            if handler is None:
                return
            self._handlers[tag] = handler
        handler(attributes)

    def _on_vertex(self, attributes: dict[str, str]) -> None:
        # Slices have vertices of their own, outside objects.
        if self.object is not None:
            self.object.coordinates.extend(
                (float(attributes["x"]), float(attributes["y"]), float(attributes["z"]))
            )

    def _on_triangle(self, attributes: dict[str, str]) -> None:
        if self.object is not None:
            self.object.corners.extend((int(attributes["v1"]), int(attributes["v2"]), int(attributes["v3"])))

    def _on_model(self, attributes: dict[str, str]) -> None:
        self.model.unit = attributes.get("unit", self.model.unit)
        if self.model.unit not in UNITS:
            raise InputError(f"{self.name} is in an unknown unit, '{self.model.unit}'; export it again.")
        for prefix in attributes.get("requiredextensions", "").split():
            extension = self.namespaces.get(prefix, prefix)
            if not any(word in extension.lower() for word in FAMILIAR):
                raise InputError(
                    f"{self.name} requires the 3MF extension '{extension}', which is not read; export it without."
                )

    def _on_object(self, attributes: dict[str, str]) -> None:
        name = attributes.get("name") or attributes.get("partnumber") or ""
        self.object = Object(name, attributes.get("type", "model"))
        if self.model.objects.setdefault(attributes["id"], self.object) is not self.object:
            raise ValueError("two objects of one number")

    def _on_component(self, attributes: dict[str, str]) -> None:
        if self.object is not None:
            self.object.components.append(_use(attributes))

    def _on_slicestack(self, _: dict[str, str]) -> None:
        self.object = None

    def _on_build(self, _: dict[str, str]) -> None:
        self.object = None

    def _on_item(self, attributes: dict[str, str]) -> None:
        self.model.items.append(_use(attributes))


def _use(attributes: dict[str, str]) -> Use:
    matrix = None
    if text := attributes.get("transform"):
        matrix = np.array([float(word) for word in text.split()]).reshape(4, 3)
    return Use(attributes.get(PATH, ""), attributes["objectid"], matrix, attributes.get("partnumber", ""))


def relationship_target(stream: Stream, name: str, kind: str) -> str:
    """The target of the first relationship whose type ends in `kind`; empty if there is none.

    Raises:
        InputError: if the XML is damaged, or declares a document type.
    """
    found: list[str] = []

    def start(tag: str, attributes: dict[str, str]) -> None:
        if tag.endswith("Relationship") and attributes.get("Type", "").endswith(kind):
            found.append(attributes.get("Target", ""))

    reader = _ModelReader(name)
    reader.parser.StartElementHandler = start
    try:
        while chunk := stream.read(CHUNK):
            reader.parser.Parse(chunk, False)
        reader.parser.Parse(b"", True)
    except (expat.ExpatError, ValueError, LookupError) as error:
        raise InputError(f"the list of parts in {name} is damaged; export or download it again.") from error
    return found[0] if found else ""
