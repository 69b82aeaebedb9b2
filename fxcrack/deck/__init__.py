"""Keyword decks (*.inp): text -> cards -> mesh, sets, surfaces -> scene and steps."""
