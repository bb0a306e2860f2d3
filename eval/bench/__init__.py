"""`resfit bench`: speed of the kernels, recovery of single primitives."""
