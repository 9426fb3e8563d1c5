"""What `zwidth --for-hands` says of a wall at the fast rate, held against an own lifting.

A device of mass m and damping d with a hand (added mass and damping, stiffness k) moves exactly under a force that is held over
a tick, and its wall takes F = K x + B (x[k] - x[k-1])/T. So a loop is a matrix of three states, whose eigenvalues tell.
"""

import json
import re
from pathlib import Path

import numpy as np
import pandas
from scipy.linalg import expm
from words.explanations import hold_columns
from words.law import said_by, unfolded
from words.sentences import hold_in_common

T = 0.001  # s
N = r"(\d[\d.]*(?:e[+-]?\d+)?)"
OUTWARDS = 1e-9  # relative: what rounding of the eigenvalues moves an end by
# A spec of a B_VE, and of 0 for every other seed.
SPEC = """[rates]
fast_hz = 1000
[device]
mass = {mass}
damping = {damping}
velocity = "difference"
[controller]
kind = "dc"
[environment]
K_VE = 100.0
B_VE = {B}
[sweep]
B_VE = {dampings}
K_VE = {{ start = 1.0, stop = 20000.0 }}
"""


def radius(device, hand, K, B):
    """Spectral radius of a device with a hand, each (mass, damping, stiffness), at a wall."""
    mass, damping, stiffness = np.add(device, hand)
    flow = np.zeros((3, 3))
    flow[0, 1] = 1.0
    flow[1] = -stiffness / mass, -damping / mass, -1 / mass
    moved = expm(flow * T)
    tick = np.zeros((3, 3))  # of x, v and the last x
    tick[:2, :2] = moved[:2, :2]
    tick[:2, 0] += moved[:2, 2] * (K + B / T)
    tick[:2, 2] -= moved[:2, 2] * B / T
    tick[2, 0] = 1.0
    return np.abs(np.linalg.eigvals(tick)).max()


def drawn_hands(rng, box=None):
    """Many hands: of a box's ends and values between them, or passive ones of all sizes without damping and with it."""
    if box:
        corners = [np.array(box)[range(3), which] for which in np.ndindex(2, 2, 2)]
        low, high = np.array(box).T
        return [*corners, *(low + (high - low) * rng.random(3) for _ in range(60))]
    masses, stiffnesses = 10 ** rng.uniform(-3, 2, 60), 10 ** rng.uniform(-1, 6, 60)
    dampings = np.where(rng.random(60) < 0.7, 0.0, rng.uniform(0, 5, 60))
    return [*zip(masses, dampings, stiffnesses, strict=True), (0.0, 0.0, 0.0)]


def hold_hands(seed, box=False):
    """Hold all that is said of a random device and its hands; in a folder of its own."""
    rng = np.random.default_rng(seed)
    mass, damping = np.round(rng.uniform(0.05, 0.3), 3), np.round(rng.uniform(0.3, 3.0), 3)
    device = (mass, damping, 0.0)
    B = float(np.round(rng.uniform(0.01, 0.3) * damping, 4))
    dampings = [B] if seed % 2 else [0.0, B]
    Path("mine.toml").write_text(SPEC.format(mass=mass, damping=damping, B=B, dampings=dampings), encoding="utf-8")
    ranges = ((0.1, 0.4), (1.0, 2.0), (100.0, 1000.0))
    of_box = ["--for-hands", "box:mass=0.1..0.4,damping=1..2,stiffness=100..1000"] if box else []
    options = ("--no-plot", "--out", "h", "--overwrite", "--jobs", "1")
    code, _, lines = said_by("zwidth", "mine.toml", "--for-hands", "passive", *of_box, *options)
    assert code == 0, lines
    table = pandas.read_csv("h/zwidth-hands.csv")
    claims = json.loads(Path("h/zwidth-hands.datapackage.json").read_text(encoding="utf-8"))["wavesweep"]["claims"]
    hands = {"free": [(0.0, 0.0, 0.0)], "passive": drawn_hands(rng), "box": drawn_hands(rng, ranges)}
    hold_rows(table, hands, device)
    hold_columns(table)
    hold_lines(unfolded(lines, "    "), table, claims)


def hold_rows(table, hands, device):
    """No hand breaks a row that holds for it, and the one that is named breaks what is beyond it."""
    assert {*table["hand"]} <= {*hands}
    for row in table[table["intervals"] > 0].to_dict("records"):
        for hand in hands[row["hand"]]:
            for K in (row["low"] * (1 + OUTWARDS), (row["low"] + row["high"]) / 2, row["high"] * (1 - OUTWARDS)):
                assert not row.get("settled", row["certified"]) or radius(device, hand, K, row["B_VE"]) < 1 + 1e-12, (
                    row,
                    hand,
                    K,
                )
        beyond = row["high"] * (1.002 if row["hand"] == "box" else 1 + 1e-6)
        if row["hand"] == "free" and row["high"] < 20000.0:
            assert radius(device, (0.0, 0.0, 0.0), beyond, row["B_VE"]) > 1, row
        if not pandas.isna(row.get("high_hand_mass")):
            named = row["high_hand_mass"], row["high_hand_damping"], row["high_hand_stiffness"]
            assert radius(device, named, beyond, row["B_VE"]) > 1, row


def hold_lines(lines, table, claims):
    """Each bound that is printed is of a row, not above it, and a search is called no proof."""
    hand = ""
    for line in lines:
        if found := re.fullmatch(r"(.*) \((\w+)\):", line):
            said, hand = found.groups()
            assert said == claims[hand]["said"], line
        elif hand and (found := re.match(rf"  largest (stable|proved) K_VE: {N} N/m at B_VE = {N} N\*s/m", line)):
            rows = table[(table["hand"] == hand) & (table["B_VE"] == float(found[3]))]
            assert rows["high"].max() * (1 - 1e-5) <= float(found[2]) <= rows["high"].max(), line
            known = rows["certified"].all()
            assert (found[1] == "proved") == (claims[hand]["status"] == "proved" and known), line
            assert line.endswith((", not certified", ", not known")) != known, line
            if named := re.search(rf"by a hand of {N} kg, {N} N\*s/m, {N} N/m", line):
                columns = rows[["high_hand_mass", "high_hand_damping", "high_hand_stiffness"]]
                assert np.isclose(columns.astype(float), [*map(float, named.groups())], rtol=5e-4).all(axis=1).any(), line
        elif found := re.fullmatch(r"  (no )?(?:stable|proved) K_VE for all of them:? ?(.*)", line):
            rows = table[table["hand"] == hand].to_dict("records")
            assert (found[1] is not None) == (not hold_in_common(rows, "B_VE", found[2])), line
        elif found := re.fullmatch(rf"  (?:all {N} rows|the only row is) (certified|not certified \(sampled bounds\))", line):
            rows = table[table["hand"] == hand]
            assert len(rows) == float(found[1] or 1)
            assert (claims[hand]["status"] == "checked") == (found[2] != "certified"), line
            assert rows["certified"].all(), line
        elif found := re.fullmatch(
            rf"  {N} of {N} rows? not (?:certified|known) \(\w+ {N}\)(?:, the others not certified \(sampled bounds\))?", line
        ):
            rows = table[table["hand"] == hand]
            assert (~rows["certified"].astype(bool)).sum() == float(found[1]) == float(found[3]), line
            assert len(rows) == float(found[2]), line
        elif re.fullmatch(r"  the only row is not certified \(\w+\)", line):
            assert table[table["hand"] == hand]["certified"].tolist() == [0], line
        elif found := re.fullmatch(rf"{N} rows? of the box not certified \(settled 0\): .*", line):
            assert (table[table["hand"] == "box"]["settled"] == 0).sum() == float(found[1]), line
        elif found := re.match(
            rf"(?:.*: )?{N} of {N} done \({N} %\)(?:, \d+ certified)? after \d+ (?:s|min|h)"
            rf"(?:; \S+ proved from {N} to {N} so far \({N} %)?",
            line,
        ):
            done, count, share, *span = map(float, filter(None, found.groups()))
            assert count == len(table[["B_VE", "hand"]].drop_duplicates()) > done, line
            assert share == int(100 * done / count), line
            assert not span or (span[1] <= table["high"].max() * (1 + 1e-3) and span[2] <= 100), line
        elif re.search(r"\bafter \d+ (?:s|min|h)\b", line):
            continue  # tells how long the run is at work
        else:
            assert re.match(r"\s*(assumes|Wrote|nowhere|no K_VE|not known|\d+ of \d+ done|still|at work|every K_VE)", line), (
                line
            )
    assert claims["passive"]["status"] == "checked"
    box = table[table["hand"] == "box"]
    assert box.empty or (box["certified"] == box["settled"]).all()
