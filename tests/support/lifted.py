"""Small readings of blocks in delta form that several tests share."""

import numpy as np


def poles(block):
    """Eigenvalues of the block's state matrix, sorted."""
    return np.sort_complex(1 + np.linalg.eigvals(block.E))


def transfer(block, w):
    """`C (w - E)^-1 B + D` at one `w = z - 1`."""
    n = len(block.states)
    return block.C @ np.linalg.solve(w * np.eye(n) - block.E, block.B + 0j) + block.D


def own_component(block, frequency_hz, period):
    """Mean of a lifted system's frame of outputs times `exp(-j w i T)`, under the frame `exp(j w i T)` of inputs."""
    ratio = len(block.inputs)
    phasor = np.exp(2j * np.pi * frequency_hz * period * np.arange(ratio))
    w = np.exp(2j * np.pi * frequency_hz * period * ratio) - 1
    return phasor.conj() @ transfer(block, w) @ phasor / ratio


def same_spectrum(found, wanted, tolerance):
    """Whether the eigenvalues `found` pair off with `wanted` to within `tolerance`."""
    left = list(wanted)
    if len(left) != len(found):
        return False
    for pole in found:
        nearest = min(range(len(left)), key=lambda i: abs(left[i] - pole))
        if abs(left.pop(nearest) - pole) > tolerance:
            return False
    return True
