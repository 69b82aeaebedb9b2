"""The bodies: materials, kinematics, loads, effects, and the forms made of them."""
