"""steps layer of fxcrack; see the modules."""
