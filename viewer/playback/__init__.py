"""The history of a fit, a fit while it goes on, and films."""
