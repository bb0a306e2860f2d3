"""See and edit assemblies: a model without windows, scenes of VTK actors, and the desktop window around both."""
