"""Model of the viewer: what is looked at and edited, without windows and without VTK."""
