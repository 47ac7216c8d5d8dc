"""Compare the builders of local models: how far each is off the full body at the contact, and what it costs on the wire."""

import numpy as np

import palpate
from palpate.local_model import Builder

BUILDERS: tuple[Builder, ...] = ("patch", "patch_rescaled", "condensed", "krylov", "hybrid")
FREQUENCY_HZ = np.array([0.0, 1.0, 10.0, 100.0])

body = palpate.Body(nodes=(8, 8, 8), fixed_faces=["z-"])
place_m = body.rest_m[body.node(4, 4, 7)]
print("builder          modes  nodes  basis, bytes  state, bytes  error of the compliance at 0, 1, 10, 100 Hz")
for builder in BUILDERS:
    model = palpate.build_model(body, at=place_m, builder=builder)
    errors = "  ".join(f"{100.0 * error:5.1f} %" for error in model.compliance_error(FREQUENCY_HZ))
    sizes = f"{len(model.packed_basis):12d}  {len(model.packed_state):12d}"
    print(f"{builder:<15}  {model.modes:5d}  {len(model.nodes):5d}  {sizes}  {errors}")
print("(hybrid: its modes alone; the springs at the contact, which the board computes exactly, come on top)")
