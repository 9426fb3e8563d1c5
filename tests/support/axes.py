"""Devices of several axes before flat walls, of which hands push along some axes."""


def before_a_wall(M, D, S, normal, B, n, late=0, along=None, most=3000):
    """The tables of a device with these matrices; along: the axes of the hand, all unless given. most: of the wall's K."""
    axes = "xyz"[: len(M)]
    along = along or axes
    wall = {"type": {2: "wall", 3: "wall-3d"}[len(M)], "K": "K", "B": "B", "every": n, "late": late}
    wall |= {f"n{a}": float(each) for a, each in zip(axes, normal, strict=True)}
    return {
        "rates": {"tick_hz": 1000},
        "numbers": {"K": 100.0, "B": B},
        "block": {
            "device": {"type": "mass_matrix", "axes": list(axes), "mass": M, "damping": D, "stiffness": S},
            "wall": wall,
        },
        "wire": {f"wall.{a}": f"device.{a}" for a in axes}
        | {f"device.f{a}": f"-wall.f{a}" + f" + hand_{a}" * (a in along) for a in axes},
        "ports": {
            "hand": {"force": [f"hand_{a}" for a in along], "displacement": [f"device.{a}" for a in along]},
            "wall": {"stiffness": "K", "damping": "B"},
        },
        "sweep": {"along": "K", "K": {"start": 0, "stop": most}},
    }
