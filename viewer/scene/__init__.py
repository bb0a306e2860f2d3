"""Scenes of VTK actors, and what may be done to them."""
