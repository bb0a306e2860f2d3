"""Optimisers: Levenberg-Marquardt and first-order ones, of one primitive and of all together."""
