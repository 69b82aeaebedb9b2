"""solve layer of fxcrack; see the modules."""
