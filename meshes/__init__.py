"""Parametric gmsh models of the usual fracture specimens, structured where the crack runs.

Every model has two bodies, ``upper`` and ``lower``, that meet along y = 0 with nodes of their own:
facets ``upper_face`` (the slave) and ``lower_face`` (the master). Which part of them is bonded is
the interface's business, so one mesh serves every initial crack length.

Each function makes the distributed mesh, and each file is a script that writes a .msh file:
``python meshes/dcb.py --out dcb.msh --dx 0.25``.
"""
