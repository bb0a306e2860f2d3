"""What is looked at and edited, without windows and without VTK."""
