"""Random specs with a set that every answer has to hold for: [for_all] of every kind, and channels."""

from meaning.specs import METHODS, Draw


def set_of(number: int, kinds: tuple | None = None) -> dict:
    """The tables of a spec; kinds of sets in turn, KINDS by default."""
    draw = Draw([11, number])
    kinds = kinds or KINDS
    kind = kinds[number % len(kinds)]
    tables = kind(draw)
    if kind in (numbers_of_controller, numbers_of_drawing) and draw.chance(0.15):
        name = draw.of(list(tables["for_all"]))
        tables["for_all"][name]["varying"] = True  # which is refused, but of lengths and delays
    return tables


def controller(draw: Draw, kinds, ratio: int = 0) -> dict:
    """A wall of a controller along K_VE, in frames of few ticks."""
    ratio = ratio or draw.whole(2, 5)
    tables = {
        "rates": {"fast_hz": 1000, "ratio": ratio},
        "device": {
            "mass": draw.size(0.05, 0.4),
            "damping": draw.size(0.5, 5.0),
            "velocity": draw.of(("exact", "difference")),
        },
        "environment": {
            "K_VE": draw.size(20.0, 1000.0),
            "B_VE": draw.or_zero(0.3, 4.0),
            "integration": draw.of(METHODS),
            "delay": draw.of(("frame", 0, 1, draw.whole(0, ratio))),
            "step": draw.of(("elapsed", "nominal")),
        },
        "controller": {
            "kind": draw.of(kinds),
            "b": draw.size(5.0, 40.0),
            "K_VC": draw.size(100.0, 2000.0),
            "B_VC": draw.size(1.0, 8.0),
        },
        "filters": {"lp1": {"order": draw.whole(0, 2), "cutoff_hz": draw.size(8.0, 60.0)}},
        "sweep": {"along": "K_VE", "K_VE": {"start": 0.0, "stop": 20000.0}},
    }
    if draw.chance(0.3):
        tables["device"]["delay"] = draw.whole(0, 2)
    if draw.chance(0.3):
        tables["operator"] = {"mass": 0.1, "damping": draw.or_zero(0.5, 4.0), "stiffness": draw.or_zero(10.0, 300.0, 0.7)}
    return tables


def lengths(draw: Draw, ratio: int, most: int = 2) -> dict:
    """Values or a range of lengths of frames, the spec's own among them or not."""
    low = draw.whole(max(1, ratio - 2), ratio)
    if draw.chance(0.5):
        return {"start": low, "stop": low + draw.whole(1, most), "varying": True}
    values = sorted({low, low + draw.whole(1, 3), low + draw.whole(2, 4)})
    return {"values": values, "varying": True}


def frames(draw: Draw) -> dict:
    tables = controller(draw, ("dc-slow", "dc-lm", "dc-vc", "pmw", "pmw-lm"))
    varied = lengths(draw, tables["rates"]["ratio"])
    shortest = varied.get("start") or min(varied["values"])
    delay = tables["environment"]["delay"]
    if delay != "frame":
        tables["environment"]["delay"] = min(delay, shortest)
    tables["for_all"] = {"rates.ratio": varied}
    if draw.chance(0.2):
        tables["device"]["dead_time"] = draw.between(0.0, 0.003)
    if draw.chance(0.3):
        tables["for_all"]["lost"] = 1
    return tables


def delays(draw: Draw) -> dict:
    tables = controller(draw, ("dc-slow", "dc-lm", "pmw", "pmw-lm"), draw.whole(2, 6))
    ratio = tables["rates"]["ratio"]
    low = draw.whole(0, ratio - 1)
    tables["for_all"] = {"environment.delay": {"start": low, "stop": draw.whole(low + 1, ratio), "varying": True}}
    if draw.chance(0.4):
        tables["for_all"]["lost"] = draw.whole(1, 2)
    if draw.chance(0.3):
        tables["for_all"]["rates.ratio"] = {"values": [ratio, ratio + draw.whole(1, 3)], "varying": True}
    return tables


def numbers_of_controller(draw: Draw) -> dict:
    """Constant numbers of a controller: ranges, wide and narrow, and lists."""
    tables = controller(draw, ("dc", "dc-slow", "dc-vc", "pmw"))
    device = tables["device"]
    centre = draw.of((device["mass"], draw.size(1.0, 12.0)))
    device["mass"] = centre
    tables["for_all"] = {"device.mass": around(draw, centre)}
    if draw.chance(0.4):
        tables["for_all"]["device.damping"] = {"start": device["damping"], "stop": round(2.5 * device["damping"], 4)}
    if draw.chance(0.3):
        tables["for_all"]["rates.ratio"] = {"values": [2, draw.whole(3, 7)]}
        tables["environment"]["delay"] = draw.of(("frame", 0, 1, 2))
    if draw.chance(0.3):
        device["dead_time"] = draw.between(0.0002, 0.002)
        tables["for_all"]["device.dead_time"] = around(draw, device["dead_time"])
    return tables


def around(draw: Draw, value: float) -> dict:
    """A range or a list about a number."""
    share = draw.of((0.001, 0.02, 0.3))
    low, high = (float(f"{value * factor:.4g}") for factor in (1 - share, 1 + share))
    if draw.chance(0.4):
        return {"values": [low, high]}
    return {"start": low, "stop": high}


def drawing(draw: Draw, link: dict, tick: int = 200) -> dict:
    """A mass that a block `link` feeds back, perhaps through a dead time before or behind it, and a filter."""
    position = draw.chance(0.7)
    tables = {
        "rates": {"tick_hz": tick},
        "numbers": {"s": draw.size(1.0, 20.0)},
        "block": {
            "x": {"type": "mass", "mass": draw.size(0.3, 3.0), "damping": draw.size(0.5, 4.0)},
            "ca": link,
        },
        "wire": {"ca.u": f"-s*x.{'x' if position else 'v'}", "x.f": "ca.y + push"},
        "ports": {"inputs": {"push": "push"}, "outputs": {"x": "x.x"}},
        "sweep": {"along": "s", "s": {"start": 0.0, "stop": 3000.0}},
    }
    if position and draw.chance(0.5):
        tables["block"]["x"]["stiffness"] = draw.size(1.0, 30.0)
    if position and draw.chance(0.4):
        tables["wire"]["ca.u"] = f"-s*(x.x + {draw.size(0.05, 0.5)}*x.v)"
    where = draw.of(("behind", "behind", "before", "none"))
    if where != "none":
        in_ticks = draw.chance(0.3)
        line = (
            {"type": "delay", "steps": draw.whole(1, 4)}
            if in_ticks
            else {"type": "delay", "seconds": draw.between(0.001, 0.04)}
        )
        tables["block"]["z"] = line
        if where == "behind":
            tables["wire"] |= {"z.u": "ca.y", "x.f": "z.y + push"}
        else:
            tables["wire"] |= {"z.u": tables["wire"]["ca.u"], "ca.u": "z.y"}
    return tables


def filtered(draw: Draw, tables: dict, clock: dict) -> None:
    """A block before the channel, which runs with it or in each tick."""
    kind = draw.of(("lowpass", "difference", "integrator", "none", "none"))
    if kind == "none":
        return
    keys = {"lowpass": {"a": draw.between(0.2, 0.9)}, "difference": {}, "integrator": {"method": draw.of(METHODS)}}[kind]
    tables["block"]["f"] = {"type": kind, **keys, **clock}
    tables["wire"]["f.u"] = "x.x"
    port = "z.u" if tables["wire"]["ca.u"] == "z.y" else "ca.u"
    law = tables["wire"][port]
    if kind == "lowpass":
        tables["wire"][port] = law.replace("x.x", "f.y")
    else:
        tables["wire"][port] = f"{law} - {'0.05' if kind == 'difference' else '0.5'}*f.y"


def messages(draw: Draw) -> dict:
    """A channel whose messages are late or lost, sometimes two."""
    every = draw.of((1, 2, 3, 5, 7))
    link = {"type": "channel", "every": every}
    if every > 1 and draw.chance(0.4):
        link["phase"] = draw.whole(0, every - 1)
    which = draw.of(("lost", "lost", "late", "both"))
    if which != "late":
        link["lost"] = draw.whole(1, 2)
    if which != "lost":
        link["late"] = draw.whole(1, 3)
    if draw.chance(0.3):
        link["missing"] = "zero"
    tables = drawing(draw, link, draw.of((100, 200, 500)))
    if draw.chance(0.3):
        filtered(draw, tables, {"every": every, "phase": link.get("phase", 0)} if draw.chance(0.7) else {})
    if draw.chance(0.2) and which == "lost":
        back = {"type": "channel", "every": draw.of((every, 1)), "lost": 1}
        tables["block"]["cb"] = back
        tables["wire"]["cb.u"] = "x.v"
        tables["wire"]["x.f"] += " - 0.3*cb.y"
    return tables


def messages_and_numbers(draw: Draw) -> dict:
    """A channel that loses, and numbers that are not known: a mass, or the dead time behind it."""
    link = {"type": "channel", "every": draw.of((2, 3, 5)), "lost": 1}
    tables = drawing(draw, link, draw.of((100, 200)))
    mass = tables["block"]["x"]["mass"]
    tables["numbers"]["m"] = mass
    tables["block"]["x"]["mass"] = "m"
    line = tables["block"].get("z", {})
    if "seconds" in line and draw.chance(0.7):
        tables["numbers"]["tau"] = line["seconds"]
        line["seconds"] = "tau"
        tables["for_all"] = {"tau": around(draw, tables["numbers"]["tau"])}
        tables["block"]["x"]["mass"] = mass
        del tables["numbers"]["m"]
    else:
        tables["for_all"] = {"m": around(draw, mass)}
    return tables


def random_messages(draw: Draw) -> dict:
    """Messages that are lost at random, by themselves or in bursts."""
    link = {"type": "channel", "every": draw.of((1, 2, 3, 5)), "loss": draw.of((0.02, 0.1, 0.3))}
    if draw.chance(0.3):
        link |= {"burst": 0.05, "burst_end": draw.of((0.2, 0.5)), "burst_loss": draw.of((1.0, 0.7))}
    if draw.chance(0.3):
        link["missing"] = "zero"
    tables = drawing(draw, link)
    tables["block"]["x"].setdefault("stiffness", draw.size(1.0, 30.0))  # so that nothing drifts
    return tables


def two_channels_at_random(draw: Draw) -> dict:
    """The same with the position over another channel, and its difference."""
    tables = random_messages(draw)
    every = tables["block"]["ca"]["every"]
    back = {"type": "channel", "every": every, "loss": draw.of((0.02, 0.1))}
    if draw.chance(0.5):
        back |= {"burst": 0.1, "burst_end": 0.5, "burst_loss": 0.8}
    tables["block"] |= {"sc": back, "dv": {"type": "difference", "every": draw.of((1, every))}}
    port = "z.u" if tables["wire"]["ca.u"] == "z.y" else "ca.u"
    law = tables["wire"][port].replace("x.x", "(sc.y + 0.2*dv.y)").replace("x.v", "dv.y")
    tables["wire"] |= {port: law, "sc.u": "x.x", "dv.u": "sc.y"}
    return tables


def two_axes(draw: Draw) -> dict:
    """Deadbeat currents in the axes of a motor that turns at an unknown speed."""
    return {
        "rates": {"tick_hz": 10_000},
        "numbers": {"s": 8.5e-4, "L": 8.5e-4, "R": draw.size(0.1, 1.0), "w": 0.0, "T": 1e-4},
        "block": {
            "m": {
                "type": "ss",
                "A": [["-R/L", "w"], ["-w", "-R/L"]],
                "B": [["1/L", 0], [0, "1/L"]],
                "C": [[1, 0], [0, 1]],
                "inputs": ["ud", "uq"],
                "outputs": ["id", "iq"],
            },
            "d": {"type": "delay", "steps": draw.whole(1, 2)},
            "q": {"type": "delay", "steps": 1},
        },
        "signals": {
            "pd": "m.id + T/s*(d.y - R*m.id + w*s*m.iq)",
            "pq": "m.iq + T/s*(q.y - R*m.iq - w*s*m.id)",
        },
        "wire": {
            "d.u": "-s/T*pd + R*pd - w*s*pq",
            "q.u": "-s/T*pq + R*pq + w*s*pd",
            "m.ud": "d.y",
            "m.uq": "q.y",
        },
        "sweep": {"along": "s", "s": {"start": 1e-5, "stop": 4e-3}},
        "for_all": {"w": {"start": draw.of((-500, 0)), "stop": draw.size(100.0, 3000.0)}},
    }


def random_frames(draw: Draw) -> dict:
    tables = controller(draw, ("dc-slow", "dc-lm"), draw.whole(2, 5))
    ratio = tables["rates"]["ratio"]
    values = [ratio, ratio + draw.whole(1, 3)]
    varied = {"values": values, "varying": True}
    if draw.chance(0.5):
        varied["shares"] = [draw.whole(1, 9), draw.whole(1, 9)]
    else:
        varied["next"] = [[draw.whole(1, 9), draw.whole(1, 9)] for _ in values]
    tables["for_all"] = {"rates.ratio": varied}
    delay = tables["environment"]["delay"]
    if delay != "frame" and draw.chance(0.5):
        weights = [draw.whole(1, 9), draw.whole(1, 9)]
        rows = [weights, [draw.whole(1, 9), draw.whole(1, 9)]] if draw.chance(0.4) else weights
        tables["for_all"]["environment.delay"] = {"values": sorted({0, draw.whole(1, ratio)}), "varying": True, "shares": rows}
    if draw.chance(0.4):
        tables["for_all"]["loss"] = draw.of((0.02, 0.2))
    return tables


def numbers_of_drawing(draw: Draw) -> dict:
    """Constant numbers of a drawn loop: a dead time, a mass, how often a block runs."""
    tables = drawing(draw, {"type": "hold", "every": "n"}, 200)
    tables["numbers"] |= {"n": draw.whole(1, 4), "m": tables["block"]["x"]["mass"]}
    tables["block"]["x"]["mass"] = "m"
    tables["for_all"] = {"m": around(draw, tables["numbers"]["m"])}
    line = tables["block"].get("z", {})
    if "seconds" in line:
        tables["numbers"]["tau"] = line["seconds"]
        line["seconds"] = "tau"
        tables["for_all"]["tau"] = around(draw, tables["numbers"]["tau"])
    if draw.chance(0.5):
        tables["for_all"]["n"] = draw.of(({"values": [1, 3]}, {"start": 2, "stop": 4}))
    return tables


def drawn_frames(draw: Draw) -> dict:
    """A drawn loop in which how often its slow blocks run varies."""
    tables = drawing(draw, {"type": "hold", "every": "n"}, 200)
    tables["numbers"]["n"] = draw.whole(2, 4)
    every = draw.of(("n", "n", "2*n"))
    tables["block"]["ca"]["every"] = every
    line = tables["block"].get("z", {})
    if line.get("steps"):
        line["every"] = draw.of((1, every))
    if draw.chance(0.5):
        filtered(draw, tables, {"every": every})
    varied = {"start": 1, "stop": 3} if draw.chance(0.4) else {"values": sorted({1, draw.whole(2, 3), draw.whole(3, 6)})}
    tables["for_all"] = {"n": varied | {"varying": True}}
    return tables


def frames_and_numbers(draw: Draw) -> dict:
    tables = controller(draw, ("dc-slow", "pmw"), draw.whole(2, 5))
    ratio = tables["rates"]["ratio"]
    tables["environment"]["delay"] = draw.of(("frame", 1))
    tables["for_all"] = {
        "rates.ratio": {"values": [ratio, ratio + draw.whole(1, 3)], "varying": True},
        "device.mass": around(draw, tables["device"]["mass"]),
    }
    return tables


def late_ticks(draw: Draw) -> dict:
    tables = controller(draw, ("dc", "dc-slow", "pmw"), draw.whole(2, 5))
    del tables["environment"]["step"]
    tables["for_all"] = {
        "tick": draw.of(({"late": 0.0003}, {"start": 0.0008, "stop": 0.00125}, {"start": 0.0009, "stop": 0.001234567}))
    }
    return tables


def contact(draw: Draw) -> dict:
    """Any wall that pushes and never pulls, also beside lengths of frames and values of numbers."""
    tables = controller(draw, ("dc-slow", "dc-slow", "pmw", "pmw-lm"))
    tables["environment"]["step"] = "elapsed"
    tables["for_all"] = {"contact": True}
    which = draw.of(("alone", "alone", "frames", "values", "delays"))
    ratio = tables["rates"]["ratio"]
    if which == "frames":
        tables["for_all"]["rates.ratio"] = {"values": [ratio, ratio + draw.whole(1, 2)], "varying": True}
    elif which == "values":
        tables["for_all"]["device.mass"] = {"values": [tables["device"]["mass"], 2 * tables["device"]["mass"]]}
    elif which == "delays":
        tables["for_all"]["environment.delay"] = {"values": [0, 1], "varying": True}
    return tables


def late_ticks_or_contact(draw: Draw) -> dict:
    return draw.of((late_ticks, contact, contact))(draw)


KINDS = (
    numbers_of_controller, frames, messages, numbers_of_drawing, delays, messages, random_messages, drawn_frames,
    messages_and_numbers, random_frames, frames_and_numbers, late_ticks_or_contact,
)  # fmt: skip
ALONE = (two_channels_at_random, two_axes)  # of which rows and `check` are held against each other alone
