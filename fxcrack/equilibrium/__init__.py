"""The interface on S, numpy only: bonds, contact, friction, cohesive bonds."""
