"""glTF files as bytes: the chunks of a GLB, the JSON, buffers and their views."""

from __future__ import annotations

import base64
import json
import os
import re
import stat
import struct
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

from resfit.errors import InputError

from .gltf_meshopt import decode_view
from .gltf_record import Record, printable

MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942

DRACO, MESHOPT = "KHR_draco_mesh_compression", "EXT_meshopt_compression"
INSTANCING = "EXT_mesh_gpu_instancing"
READ = {DRACO, MESHOPT, INSTANCING, "KHR_mesh_quantization"}
"""Extensions that change geometry, and are read here."""
HARMLESS = re.compile(
    r"[A-Z0-9]+_(materials?|textures?|lights?|packing|animation|xmp|audio|mesh_features|structural_metadata)(_|$)"
    r"|VRMC?(_|$)|EXT_mesh_manifold$|FB_ngon_encoding$|KHR_techniques_webgl$|CESIUM_primitive_outline$"
)
"""Names of extensions that leave geometry as it is."""

REPEATS = 10_000_000
"""Vertices and faces that a file may make by repeating its meshes, beside those that its bytes can hold."""
PER_BYTE = 8
"""Vertices and corners that one byte can hold: dense compression needs one or two bits for each."""


class Document:
    """A glTF file: its JSON, and the bytes of its buffers, each read when it is first asked for."""

    def __init__(self, path: Path) -> None:
        """Read the file, and the JSON in it.

        Raises:
            InputError: if it is damaged, of another version, or needs an extension that is not read here.
        """
        self.path = path
        self.notes: dict[str, None] = {}
        """Sentences about what was left out or taken otherwise than the file says, each once."""
        data = path.read_bytes()
        self._bytes = len(data)
        text, self._binary = _chunks(path, data) if data[:4] == MAGIC else (data, None)
        self.root = Record(path, "", _parse(path, text))
        _check_version(self.root)
        for name in self.root.texts("extensionsRequired"):
            if name not in READ and not HARMLESS.match(name):
                raise InputError(
                    f"'{path}' needs the glTF extension '{printable(name)}', which is not read here; export it"
                    " without that extension."
                )
        self._buffers: dict[int, memoryview] = {}
        self._views: dict[int, tuple[memoryview, int]] = {}
        self._buffer_records = self.root.records("buffers")
        self.view_records = self.root.records("bufferViews")
        self._taken = 0

    def view(self, index: int) -> tuple[memoryview, int]:
        """The bytes of a bufferView, decompressed, and its byteStride (0: elements are packed).

        Raises:
            InputError: if it reaches beyond its buffer, or its data is damaged.
        """
        if index not in self._views:
            record = self.view_records[index]
            packed = record.extension(MESHOPT)
            if packed is None:
                stride = record.integer("byteStride", 0, low=1) if "byteStride" in record.value else 0
                self._views[index] = self._slice(record), stride
            else:
                self._views[index] = (
                    memoryview(decode_view(packed, self._slice(packed))),
                    packed.integer("byteStride"),
                )
        return self._views[index]

    def size(self) -> int:
        """Bytes of the file and of all its buffers."""
        for index, record in enumerate(self._buffer_records):
            if "uri" in record.value:
                self._buffer(index)
        return self._bytes

    def take(self, count: int) -> None:
        """Say that `count` vertices and faces are about to be made.

        Raises:
            InputError: if these are more than the file can hold, even with meshes that are repeated.
        """
        self._taken += count
        if self._taken > REPEATS + PER_BYTE * self._bytes:
            raise InputError(
                f"'{self.path}' repeats its meshes so often that more than {REPEATS // 10**6} million vertices and"
                " faces come out; export it with fewer copies."
            )

    def _slice(self, record: Record) -> memoryview:
        buffer = self._buffer(record.integer("buffer", high=len(self._buffer_records) - 1))
        start = record.integer("byteOffset", 0)
        end = start + record.integer("byteLength")
        if end > len(buffer):
            raise InputError(
                f"'{self.path}' is cut short: {record.where} ends at byte {end} of a buffer of {len(buffer)};"
                " export or download it again."
            )
        return buffer[start:end]

    def _buffer(self, index: int) -> memoryview:
        if index not in self._buffers:
            record = self._buffer_records[index]
            uri = record.text("uri")
            if uri[:5].lower() == "data:":
                found = _decode_data_uri(record, uri)
            elif uri:
                found = _read_beside(self.path, uri)
                self._bytes += len(found)
            elif index == 0 and self._binary is not None:
                found = self._binary
            else:
                raise record.invalid("uri", "the name of a file")
            self._buffers[index] = memoryview(found)
        return self._buffers[index]


def _chunks(path: Path, data: bytes) -> tuple[bytes, memoryview | None]:
    """The JSON of a GLB, and its binary chunk if it has one."""
    version = int.from_bytes(data[4:8], "little")
    if version != 2:
        raise InputError(f"'{path}' is a GLB of glTF {version}; export it as glTF 2.0.")
    text, position = None, 12
    while position + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, position)
        start, position = position + 8, position + 8 + length
        # Chunks of other kinds are for others, and bytes behind the last chunk for nobody.
        if kind not in (JSON_CHUNK, BINARY_CHUNK):
            continue
        if position > len(data):
            raise InputError(
                f"'{path}' is cut short: it says it has {position} bytes but has {len(data)}; export or download it"
                " again."
            )
        if kind == BINARY_CHUNK:
            if text is None:
                break
            return text, memoryview(data)[start:position]
        text = data[start:position] if text is None else text
    if text is None:
        raise InputError(f"'{path}' is no valid GLB: it does not begin with a JSON chunk; export it again.")
    return text, None


def _parse(path: Path, text: bytes) -> object:
    try:
        # Names in another encoding than UTF-8 must not stop the reading.
        return json.loads(text.rstrip(b"\0 ").decode("utf-8-sig", errors="replace"))
    except (ValueError, RecursionError):
        kind = path.suffix.upper().lstrip(".") or "glTF"
        raise InputError(
            f"'{path}' is no {kind} file that can be read: it holds no valid JSON; export it again."
        ) from None


def _check_version(root: Record) -> None:
    asset = root.record("asset")
    least, version = asset.text("minVersion", "2.0"), asset.text("version", "2.0")
    if isinstance(root.value.get("meshes"), dict):
        # In glTF 1 meshes have names for indices.
        version = "1.0"
    if least != "2.0" or not version.startswith("2."):
        found = printable(least if least != "2.0" else version)
        raise InputError(f"'{root.path}' is glTF {found}, which is not read here; export it as glTF 2.0.")


def _decode_data_uri(record: Record, uri: str) -> bytes:
    head, _, payload = uri.partition(",")
    if not head.lower().endswith(";base64"):
        return unquote_to_bytes(payload)
    try:
        return base64.b64decode(unquote(payload) + "=" * (-len(payload) % 4))
    except ValueError:
        raise record.invalid("uri", "valid base64") from None


def _read_beside(path: Path, uri: str) -> bytes:
    """The bytes of a file that a URI names, which is in the folder of the glTF file or below."""
    folder = path.parent.resolve()
    shown = printable(unquote(uri))
    for name in dict.fromkeys((unquote(uri), uri)):
        try:
            found = (folder / name).resolve()
            if re.match(r"[a-zA-Z][a-zA-Z0-9+.-]*:|[/\\]", uri) or not found.is_relative_to(folder):
                raise InputError(
                    f"'{path}' needs '{shown}', which is not in its folder; put that file beside it, and write its bare"
                    " name as the URI."
                )
            mode = os.stat(found).st_mode
        except FileNotFoundError:
            continue
        except (ValueError, RuntimeError):
            # A NUL or a lone surrogate, which no file name has; links in a circle.
            continue
        if not stat.S_ISREG(mode):
            raise InputError(f"'{path}' needs '{shown}', which is no regular file; export it again.")
        return found.read_bytes()
    raise InputError(
        f"'{path}' needs '{shown}' beside it, which is not there; export or download both files again."
    )
