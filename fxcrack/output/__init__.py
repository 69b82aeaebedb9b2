"""output layer of fxcrack; see the modules."""
