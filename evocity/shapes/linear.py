"""Linear algebra of small matrices: norms, radii, solutions, affine maps; all uses of LAPACK.

Matrices are of 3 × 3, or of an automaton's states; no birth of a search depends on its speed.
"""

import numpy as np
import scipy

#: The functions of NumPy that other modules need, unchanged.
determinants, solve, cholesky = np.linalg.det, np.linalg.solve, np.linalg.cholesky


def norms(parts: np.ndarray) -> np.ndarray:
    """Compute the spectral norms ``(k,)`` of matrices ``(k, m, m)``."""
    return np.linalg.norm(parts, ord=2, axis=(1, 2)) if len(parts) else np.zeros(0)


def radii(parts: np.ndarray) -> np.ndarray:
    """Compute the spectral radii ``(k,)`` of matrices ``(k, m, m)``."""
    return np.abs(np.linalg.eigvals(parts)).max(axis=1) if len(parts) else np.zeros(0)


def fixed_vector(matrix: np.ndarray) -> np.ndarray:
    """Find the fixed vector of sum 1 of a ``matrix`` whose columns sum to 1."""
    size = len(matrix)
    rows = np.vstack([matrix - np.eye(size), np.ones((1, size))])
    right = np.append(np.zeros(size), 1.0)
    return np.linalg.lstsq(rows, right, rcond=None)[0]


def conditions(matrix: np.ndarray) -> float:
    """Compute the condition number of a ``matrix``; 1 for an empty one."""
    lengths = np.linalg.svd(matrix, compute_uv=False)
    return float(lengths[0] / max(lengths[-1], 1e-300)) if len(lengths) else 1.0


def null_rows(matrix: np.ndarray) -> np.ndarray:
    """Find orthonormal rows ``(n - m, n)`` of the null space of a ``matrix`` ``(m, n)`` of rank
    m."""
    rows, columns = matrix.shape
    return np.linalg.qr(matrix.T, mode="complete")[0].T[rows:] if rows else np.eye(columns)


def solve_banded(diagonals: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solve a positive definite matrix, given by its lower ``diagonals`` ``(b, n)``, for ``right``
    ``(n,)`` or ``(n, k)``, real or complex. Entries of ``diagonals`` beyond the matrix are
    ignored."""
    diagonals = diagonals[: len(right)]
    return scipy.linalg.solveh_banded(diagonals, right, lower=True, check_finite=False)


def polar(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Decompose a ``matrix`` into an orthogonal turn after a symmetric stretch."""
    left, lengths, right = np.linalg.svd(matrix)
    turn = np.einsum("ij,jk->ik", left, right)
    return turn, np.einsum("ji,j,jk->ik", right, lengths, right)


def compose_maps(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Compose affine maps ``(…, m, m + 1)``: ``inner`` first, then ``outer``."""
    size = outer.shape[-2]
    composed = np.einsum("...ij,...jk->...ik", outer[..., :size], inner)
    composed[..., size] += outer[..., size]
    return composed


def apply_maps(maps: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Apply affine ``maps`` ``(…, m, m + 1)`` to ``points`` ``(n, m)``: ``(…, n, m)``."""
    size = maps.shape[-2]
    return np.einsum("...ij,nj->...ni", maps[..., :size], points) + maps[..., None, :, size]
