"""interface layer of fxcrack; see the modules."""
