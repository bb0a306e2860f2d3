"""Candidates: primitives fitted to regions from many starts."""
