"""Which candidates cover which sample points, and what a choice among them gains."""
