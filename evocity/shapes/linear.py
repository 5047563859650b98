"""Small matrices: norms, radii, products. What asks LAPACK stands here alone.

No birth of a search waits for it: matrices of 3 × 3 and automata of some states.
"""

import numpy as np
import scipy


def norms(parts: np.ndarray) -> np.ndarray:
    """Spectral norms ``(k,)`` of matrices ``(k, m, m)``."""
    return np.linalg.norm(parts, ord=2, axis=(1, 2)) if len(parts) else np.zeros(0)


def radii(parts: np.ndarray) -> np.ndarray:
    """Spectral radii ``(k,)`` of matrices ``(k, m, m)``."""
    return np.abs(np.linalg.eigvals(parts)).max(axis=1) if len(parts) else np.zeros(0)


def determinants(parts: np.ndarray) -> np.ndarray:
    """Determinants ``(k,)`` of matrices ``(k, m, m)``."""
    return np.linalg.det(parts)


def solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    """x of ``matrix`` x = ``right``."""
    return np.linalg.solve(matrix, right)


def fixed_of(matrix: np.ndarray) -> np.ndarray:
    """The vector of sum 1 that a ``matrix`` whose columns sum to 1 leaves as it is."""
    size = len(matrix)
    rows = np.vstack([matrix - np.eye(size), np.ones((1, size))])
    right = np.append(np.zeros(size), 1.0)
    return np.linalg.lstsq(rows, right, rcond=None)[0]


def conditions(matrix: np.ndarray) -> float:
    """How many times longer a ``matrix`` makes one vector than another; 1 of an empty one."""
    lengths = np.linalg.svd(matrix, compute_uv=False)
    return float(lengths[0] / max(lengths[-1], 1e-300)) if len(lengths) else 1.0


def nothing_of(matrix: np.ndarray) -> np.ndarray:
    """Orthonormal rows ``(n - m, n)`` of which a ``matrix`` ``(m, n)`` of rank m makes nothing."""
    rows, columns = matrix.shape
    return np.linalg.qr(matrix.T, mode="complete")[0].T[rows:] if rows else np.eye(columns)


def lower_of(matrix: np.ndarray) -> np.ndarray:
    """The lower triangle L of a positive definite ``matrix`` L Lᵀ."""
    return np.linalg.cholesky(matrix)


def banded_solved(diagonals: np.ndarray, right: np.ndarray) -> np.ndarray:
    """x of a positive definite matrix told by its lower ``diagonals`` ``(b, n)``, of ``right``
    ``(n,)`` or ``(n, k)``, real or complex. What ``diagonals`` have beyond the matrix does not
    count."""
    diagonals = diagonals[: len(right)]
    return scipy.linalg.solveh_banded(diagonals, right, lower=True, check_finite=False)


def polar(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A ``matrix`` as a turn, orthogonal, after a symmetric stretch."""
    left, lengths, right = np.linalg.svd(matrix)
    turn = np.einsum("ij,jk->ik", left, right)
    return turn, np.einsum("ji,j,jk->ik", right, lengths, right)


def after(outer: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Affine maps ``(…, m, m + 1)``: ``inner`` first, then ``outer``."""
    size = outer.shape[-2]
    found = np.einsum("...ij,...jk->...ik", outer[..., :size], inner)
    found[..., size] += outer[..., size]
    return found


def moved(maps: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Where affine ``maps`` ``(…, m, m + 1)`` take ``points`` ``(n, m)``: ``(…, n, m)``."""
    size = maps.shape[-2]
    return np.einsum("...ij,nj->...ni", maps[..., :size], points) + maps[..., None, :, size]


__all__ = [
    "after",
    "banded_solved",
    "conditions",
    "determinants",
    "fixed_of",
    "lower_of",
    "moved",
    "norms",
    "nothing_of",
    "polar",
    "radii",
    "solved",
]
