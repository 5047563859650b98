"""Small matrices: norms, radii, products. What asks LAPACK stands here alone.

No birth of a search waits for it: matrices of 3 × 3 and automata of some states.
"""

import numpy as np


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


__all__ = ["after", "determinants", "fixed_of", "moved", "norms", "polar", "radii", "solved"]
