"""Touch a body in ten lines: a tip goes 4 mm into a soft block, and the block pushes back."""

import numpy as np

import palpate

body = palpate.Body(nodes=(8, 8, 8), stiffness_N_m=100.0, fixed_faces=["z-"])
top_m = body.rest_m[body.node(4, 4, 7)]
for depth_m in np.linspace(-0.001, 0.004, 200):  # 200 servo ticks of 1 ms
    touch = body.touch(top_m - [0.0, 0.0, depth_m])
print(f"{touch.mode} at {depth_m * 1e3:.1f} mm: {-touch.force_N[2]:.2f} N up into the hand")
