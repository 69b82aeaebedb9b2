"""Foundation: types, errors, checks, logging, files, processes, the DOLFINx version layer."""
