"""Demonstrations: each module learns you one thing, has `run()` for numbers and `main()` for files."""
