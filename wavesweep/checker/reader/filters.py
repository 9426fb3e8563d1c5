"""Digital filters from their analog ones by the bilinear transform, as (A, B, C, D): lists, and D a coefficient.

A Butterworth filter of order n is a series of sections. Of the pair of poles k = 0 .. n/2 - 1 at the angles +-a, where
a = pi (2 k + n + 1)/(2 n), r = cos a and t = sin a, the analog one has, in units of its cutoff,

    A = [[r, t], [-t, r]],   B = (0, 1)',   low-pass C = (1/t, 0), D = 0;   high-pass C = ((2 r^2 - 1)/t, 2 r), D = 1,

and of the last pole of an odd order A = -1, B = 1, C = 1 and D = 0, of a high-pass C = -1 and D = 1. With w = tan(pi fc/fs), fc the
cutoff and fs the rate of the filter, and E = (1 - w A)^-1, the digital section has

    E (1 + w A),   2 w E B,   C E,   D + w C E B

in their places: of first order ((1 - w)/(1 + w), 2 w/(1 + w), 1/(1 + w), w/(1 + w)), so its state is 1 + w times as large as that
of other realisations. A transfer function b/a of order n, a0 = 1, has the first row -a1 .. -an and ones below the diagonal in A,
B = (1, 0 .. 0)', C = (b1 - b0 a1 .. bn - b0 an) and D = b0.
"""

from .loops import Unreadable, dot

MOST = 12  # poles of a filter


def butterworth(order: int, warped, side: str, arithmetic) -> list[tuple]:
    """Sections in series: for each pair of poles of 1/(1 + s^2n) one of second order, in its normal form.

    warped: tan(pi cutoff/rate), with which s = (z - 1)/(z + 1)/warped in units of the cutoff.
    """
    if order > MOST:
        raise Unreadable(f"a filter of order {order}")
    sections = []
    for number in range(order // 2):
        angle = arithmetic.pi * (2 * number + order + 1) / (2 * order)
        real = arithmetic.cos(angle)
        turn = arithmetic.sin(angle)
        A = [[real, turn], [-turn, real]]  # poles real +- j turn, of modulus 1
        low = [1 / turn, 0]  # low (s - A)^-1 B = 1/(s^2 - 2 real s + 1)
        last = 0
        if side != "low":  # s^2/(...) = 1 + (2 real s - 1)/(...), and s/(...) = (0, 1) + real low
            low = [2 * real * real * low[0] - low[0], 2 * real]
            last = 1
        real_part = 1 - warped * real
        aside = warped * turn
        size = real_part * real_part + aside * aside
        inverse = [[real_part / size, aside / size], [-aside / size, real_part / size]]
        sections.append(_bilinear(A, [0, 1], low, last, warped, inverse))
    if order % 2:
        share = 1 if side == "low" else -1
        inverse = [[1 / (1 + warped)]]
        sections.append(_bilinear([[-1]], [1], [share], 0 if side == "low" else 1, warped, inverse))
    return sections


def _bilinear(A, B, C, D, a, inverse):
    """C (s - A)^-1 B + D with s = (z - 1)/(z + 1)/a; inverse: (1 - a A)^-1."""
    places = range(len(B))
    right = [[int(row == column) + a * A[row][column] for column in places] for row in places]
    moved = [dot(inverse[row], B) for row in places]
    seen = [dot(C, [inverse[row][column] for row in places]) for column in places]
    turned = [
        [dot(inverse[row], [right[of][column] for of in places]) for column in places]
        for row in places
    ]
    return turned, [2 * a * x for x in moved], seen, D + a * dot(C, moved)


def order_and_cutoff(edges: dict, warped, side: str, arithmetic) -> tuple[int, object]:
    """The least order that keeps both edges, and tan(pi cutoff/rate) of the cutoff with which the passband is met exactly.

    warped: tan(pi hertz/rate) of a frequency.
    """
    passing = warped(edges["passband_hz"])
    stopping = warped(edges["stopband_hz"])
    wide = stopping / passing if side == "low" else passing / stopping
    if arithmetic.ends(edges["stopband_db"] - edges["passband_db"])[0] <= 0:
        raise Unreadable("a filter whose stopband_db is not above passband_db")
    lost = _power_of_ten(edges["passband_db"], arithmetic) - 1
    rejection = _power_of_ten(edges["stopband_db"], arithmetic) - 1
    order = 1
    while not arithmetic.at_least(wide ** (2 * order) * lost, rejection):
        order += 1
        if order > MOST:
            raise Unreadable("edges of a filter that no order keeps")
    shift = arithmetic.exp(arithmetic.log(lost) / (2 * order))
    return order, passing / shift if side == "low" else passing * shift


def _power_of_ten(decibels, arithmetic):
    return arithmetic.exp(arithmetic.log(arithmetic.number(10)) * arithmetic.number(decibels) / 10)


def transfer(numerator, denominator) -> tuple:
    """A state-space model of a transfer function in descending powers, in controllable form."""
    if not denominator or not denominator[0]:
        raise Unreadable("a transfer function whose first coefficient of den is 0")
    order = len(denominator) - 1
    if not 0 < len(numerator) <= len(denominator):
        raise Unreadable("a transfer function with more coefficients in num than in den, or none")
    numerator = [0] * (order + 1 - len(numerator)) + numerator
    b = [entry / denominator[0] for entry in numerator]
    a = [entry / denominator[0] for entry in denominator]
    A = [[-entry for entry in a[1:]]] if order else []
    A += [[int(column == row) for column in range(order)] for row in range(order - 1)]
    B = [int(row == 0) for row in range(order)]
    return A, B, [b[row + 1] - b[0] * a[row + 1] for row in range(order)], b[0]
