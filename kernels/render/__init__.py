"""Pictures of fields and meshes by tracing rays."""
