"""Loops whose frames vary in any order: proved stable for every order, or refuted by a pattern of frames."""
