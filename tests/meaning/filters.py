"""Digital filters from their analog ones by the bilinear transform, as matrices A, B, C, D."""

import math

import numpy as np

Model = tuple[np.ndarray, np.ndarray, np.ndarray, float]


def butterworth(order: int, hertz: float, rate: float, side: str) -> list[Model]:
    """Sections in series: for each pair of poles of 1/(1 + s^2n) one of second order, in its normal form."""
    warped = math.tan(math.pi * hertz / rate)  # s = (z - 1)/(z + 1)/warped, in units of the cutoff
    sections = []
    for number in range(order // 2):
        angle = math.pi * (2 * number + order + 1) / (2 * order)
        real = math.cos(angle)
        turn = math.sin(angle)
        A = np.array([[real, turn], [-turn, real]])  # poles real +- j turn, of modulus 1
        B = np.array([0.0, 1.0])
        low = np.array([1 / turn, 0.0])  # low (s - A)^-1 B = 1/(s^2 - 2 real s + 1)
        if side == "low":
            sections.append(bilinear(A, B, low, 0.0, warped))
        else:  # s^2 over the same is 1 + (2 real s - 1) over it, and s/(...) = (0, 1) + real low
            derivative = np.array([0.0, 1.0]) + real * low
            sections.append(bilinear(A, B, 2 * real * derivative - low, 1.0, warped))
    if order % 2:
        A = np.array([[-1.0]])
        B = np.array([1.0])
        if side == "low":
            sections.append(bilinear(A, B, np.array([1.0]), 0.0, warped))
        else:
            sections.append(bilinear(A, B, np.array([-1.0]), 1.0, warped))
    return sections


def bilinear(A, B, C, D, a) -> Model:
    """C (s - A)^-1 B + D with s = (z - 1)/(z + 1)/a."""
    I = np.eye(len(A))
    inverse = np.linalg.inv(I - a * A)
    root = math.sqrt(2 * a)
    return inverse @ (I + a * A), root * inverse @ B, root * C @ inverse, D + a * C @ inverse @ B


def order_and_cutoff(edges: dict, rate: float, side: str) -> tuple[int, float]:
    """The least order that keeps both edges, and the cutoff with which the passband is met exactly."""
    passing = math.tan(math.pi * edges["passband_hz"] / rate)
    stopping = math.tan(math.pi * edges["stopband_hz"] / rate)
    wide = stopping / passing if side == "low" else passing / stopping
    lost = 10 ** (edges["passband_db"] / 10) - 1
    kept = 10 ** (edges["stopband_db"] / 10) - 1
    order = math.ceil(math.log(kept / lost) / (2 * math.log(wide)))
    shift = lost ** (1 / (2 * order))
    cutoff = passing / shift if side == "low" else passing * shift
    return order, math.atan(cutoff) * rate / math.pi


def transfer(numerator, denominator) -> Model:
    """A state-space model of a transfer function in descending powers, in controllable form."""
    denominator = np.trim_zeros(np.array(denominator, float), "f")
    order = len(denominator) - 1
    numerator = np.array(numerator, float)
    numerator = np.concatenate([np.zeros(order + 1 - len(numerator)), numerator])[-order - 1 :]
    numerator = numerator / denominator[0]
    denominator = denominator / denominator[0]
    A = np.zeros((order, order))
    B = np.zeros(order)
    if order:
        A[0] = -denominator[1:]
        A[1:, :-1] = np.eye(order - 1)
        B[0] = 1.0
    D = numerator[0]
    return A, B, numerator[1:] - D * denominator[1:], float(D)
