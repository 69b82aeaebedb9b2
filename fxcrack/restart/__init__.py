"""Checkpoints, fingerprints and the restart of a run."""
