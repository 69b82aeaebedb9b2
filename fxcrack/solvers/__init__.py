"""Solvers of a scene: linear condensed bodies, nonlinear bodies by Newton's method."""
