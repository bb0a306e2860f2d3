"""The desktop window: panel, gizmo, mouse and keys."""
