"""Demonstrations: each module teaches one thing; `run()` gives numbers, `main()` files."""
