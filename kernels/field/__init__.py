"""The signed distance field of primitives and of their union, its gradient and its adjoint."""
