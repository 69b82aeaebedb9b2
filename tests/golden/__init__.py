"""Golden histories: one small scene per capability, compared with stored histories."""
