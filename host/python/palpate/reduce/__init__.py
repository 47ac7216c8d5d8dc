"""Order reduction of a body as its contact node sees it (section 2.2 of the paper).

`system`: from a scene's body to the linear system. `projection`: rational Krylov, with a certified error.
`balance`: balanced truncation. `study`: both, with errors and times. Mathematics and measurements: docs/reduction.md.
"""
