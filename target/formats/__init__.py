"""Mesh files: one reader per format, all of them returning a `MeshFile`."""
