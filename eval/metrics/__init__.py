"""Metrics of a reconstruction, and the reading of what is to be scored."""
