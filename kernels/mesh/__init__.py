"""Triangle meshes: closest points, signs, distance grids."""
