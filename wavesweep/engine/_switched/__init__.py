"""Switched systems: matrices in any order that a graph allows, and norms in which all shrink."""
