"""Compiled D4 coordinates of blocks, by rows of a map and at any place."""
