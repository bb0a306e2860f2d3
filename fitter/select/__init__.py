"""The choice among candidates, and of how many to keep."""
