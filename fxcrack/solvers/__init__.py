"""Solvers of a scene: linear condensed, nonlinear by Newton's method, explicit dynamics."""
