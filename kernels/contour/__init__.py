"""Meshes of fields: dual contouring."""
