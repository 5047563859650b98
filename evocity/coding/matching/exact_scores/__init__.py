"""Compiled scores of domain blocks in float64, which decide near-ties."""
