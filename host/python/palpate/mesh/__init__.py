"""Bodies from meshes: tetrahedra, or a surface that is filled with them, made into masses, springs and dampers (docs/bodies.md)."""
