"""Least squares of many primitives at once: residuals, normal equations, damped steps."""
