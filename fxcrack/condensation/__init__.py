"""From the stiffness K to the dense matrix S on the retained jumps."""
