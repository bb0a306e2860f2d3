"""The objective of a fit, on samples of its target."""
