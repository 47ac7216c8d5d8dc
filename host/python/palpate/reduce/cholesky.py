"""Sparse Cholesky factors of a K + b B + c I for changing a, b, c: CHOLMOD by way of cvxopt, one symbolic analysis."""

from collections.abc import Callable
from typing import Any

import cvxopt
import cvxopt.cholmod
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Solve = Callable[[NDArray[np.float64]], NDArray[np.float64]]


class NotPositiveDefiniteError(ArithmeticError):
    """There is no Cholesky factor."""


class ShiftedCholesky:
    """Factors of combinations of two symmetric (d, d) matrices and the identity."""

    def __init__(self, stiffness: sp.csc_matrix, damping: sp.csc_matrix | None) -> None:
        size = stiffness.shape[0]
        self.stiffness = stiffness
        self.damping = sp.csc_matrix(stiffness.shape) if damping is None else damping
        identity = sp.eye_array(size, format="csc")
        lower = [sp.tril(matrix, format="csc") for matrix in (self.stiffness, self.damping, identity)]
        for matrix in lower:
            matrix.eliminate_zeros()  # the sum below leaves them out too
        pattern = sp.csc_matrix(sum(abs(matrix) for matrix in lower))
        keys = _keys(pattern)
        self._data = []
        for matrix in lower:
            data = np.zeros(len(keys))
            data[np.searchsorted(keys, _keys(matrix))] = matrix.data
            self._data.append(data)
        columns = np.repeat(np.arange(size), np.diff(pattern.indptr))
        self._matrix = cvxopt.spmatrix(
            np.ones(len(keys)), pattern.indices.astype(np.int64), columns.astype(np.int64), (size, size)
        )
        self._symbolic: Any = cvxopt.cholmod.symbolic(self._matrix)

    def factor(self, stiffness: float, damping: float, identity: float = 0.0) -> Solve:
        """A function from right sides (d, columns) to solutions, good until the next call of `factor`. Raises
        NotPositiveDefiniteError."""
        k, b, i = self._data
        self._matrix.V = cvxopt.matrix(stiffness * k + damping * b + identity * i)
        try:
            cvxopt.cholmod.numeric(self._matrix, self._symbolic)
        except ArithmeticError:
            raise NotPositiveDefiniteError from None

        def solve(right: NDArray[np.float64]) -> NDArray[np.float64]:
            unknown = cvxopt.matrix(np.ascontiguousarray(right))
            cvxopt.cholmod.solve(self._symbolic, unknown)
            return np.array(unknown)

        return solve


def _keys(matrix: sp.csc_matrix) -> NDArray[np.int64]:
    """One ascending number for each place in the matrix that holds something."""
    matrix.sort_indices()
    columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr)).astype(np.int64)
    return columns * matrix.shape[0] + matrix.indices
