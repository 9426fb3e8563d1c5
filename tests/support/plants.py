"""Plants of several bodies: as blocks with springs between them, and as one state-space model."""

import numpy as np

HELD = "-kp*m0.x - kd*m0.v"
WAYS = ("product", "multiplied out", "block")


def bodies(seed, way=None):
    """Random bodies in a row, with further springs between them, PD on the first one and a hand on the last one.

    Returns the tables of both, and A, B of the states (positions, velocities) under the torque of PD and the hand's force.
    """
    r, way = np.random.default_rng(seed), way or WAYS[seed % len(WAYS)]
    n = int(r.integers(2, 7))
    m, d = np.exp(r.uniform(-2, 1, n)), np.where(r.random(n) < 0.5, 0.0, r.uniform(0, 1, n))
    pairs = [(i, j) for i in range(n) for j in range(i) if j == i - 1 or r.random() < 0.3]
    blocks = {f"m{i}": {"type": "mass", "mass": m[i], "damping": d[i]} for i in range(n)}
    forces, wires = {i: [] for i in range(n)}, {}
    A, B, C = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 2)), np.zeros((3, 2 * n))
    A[:n, n:], A[n:, n:] = np.eye(n), -np.diag(d / m)
    for i, j in pairs:
        k, c = float(np.exp(r.uniform(3, 10))), float(r.uniform(0, 2))
        for a, b in ((i, j), (j, i)):
            A[n + a, [b, a, n + b, n + a]] += np.array([k, -k, c, -c]) / m[a]
            forces[a].append(
                {
                    "product": f"{k!r}*(m{b}.x - m{a}.x) + {c!r}*(m{b}.v - m{a}.v)",
                    "multiplied out": f"{k!r}*m{b}.x - {k!r}*m{a}.x + {c!r}*m{b}.v - {c!r}*m{a}.v",
                    "block": f"s{i}{j}.f{1 + (a == j)}",
                }[way]
            )
        if way == "block":
            blocks[f"s{i}{j}"] = {"type": "spring", "k": k, "d": c}
            ends = ((1, i), (2, j))
            wires |= {f"s{i}{j}.{port}{end}": f"m{body}.{port}" for end, body in ends for port in "xv"}
    wires |= {f"m{i}.f": " + ".join(force) for i, force in forces.items()}
    wires["m0.f"] += f" + {HELD}"
    wires[f"m{n - 1}.f"] += " + push"
    B[n, 0], B[2 * n - 1, 1], C[0, 0], C[1, n], C[2, n - 1] = 1 / m[0], 1 / m[n - 1], 1, 1, 1
    ports = {"inputs": ["tau", "push"], "outputs": ["q", "w", "l"]}
    one = {"type": "ss", "A": A.tolist(), "B": B.tolist(), "C": C.tolist(), **ports}
    tables = {"rates": {"tick_hz": float(r.choice([200, 500, 1000, 2000]))}, "numbers": {"kp": 100.0, "kd": 20 * m[0]}}
    whole = {
        "wire": {"p.tau": "-kp*p.q - kd*p.w", "p.push": "push"},
        "ports": {"hand": {"force": "push", "displacement": "p.l"}},
    }
    apart = {"wire": wires, "ports": {"hand": {"force": "push", "displacement": f"m{n - 1}.x"}}}
    return tables | {"block": blocks} | apart, tables | {"block": {"p": one}} | whole, A, B


def joint(ks=10000.0, between=None, **wires):
    """An elastic joint: motor and link with a spring between, and PD on the motor at 1 kHz."""
    between = between or ("ks*(link.x - motor.x)", "ks*(motor.x - link.x)")
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"kp": 200.0, "kd": 2.0, "ks": ks},
        "block": {"motor": {"type": "mass", "mass": 0.1, "damping": 0.1}, "link": {"type": "mass", "mass": 0.5}},
        "wire": {"motor.f": f"-kp*motor.x - kd*motor.v + {between[0]}", "link.f": f"{between[1]} + push"} | wires,
        "ports": {"hand": {"force": "push", "displacement": "link.x", "turns": True}},
    }
