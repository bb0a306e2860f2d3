"""Regularity of a result: symmetry, canonical shapes, equal axes, sizes and centres."""
