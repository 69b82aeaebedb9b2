"""Hard cases: each test says what is hard, what must hold, and how that is checked."""
