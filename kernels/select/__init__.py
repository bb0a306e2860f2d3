"""Coverage of sample points by candidates, and the gain of a choice among them."""
