"""Stages that families share: profile, trapezoid and bend."""
