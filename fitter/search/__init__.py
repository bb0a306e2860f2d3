"""The rounds of a fit, from one or several beginnings, of a whole or part by part."""
