"""The noun of the whole: an assembly of primitives, its file, its place in the mesh's frame."""
