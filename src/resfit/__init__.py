"""ResFit: any 3D mesh as a compact, editable assembly of analytic primitives."""
