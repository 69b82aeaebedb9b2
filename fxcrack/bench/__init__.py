"""Benchmarks: the two speed problems, what they are compared with, and how they are measured."""
