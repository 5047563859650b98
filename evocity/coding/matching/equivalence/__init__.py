"""Compiled equivalence of blocks: kinds of domain blocks, shapes of range blocks, Z-order."""
