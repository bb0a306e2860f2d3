"""From a target and what is already explained to regions, and from regions to starting primitives."""
