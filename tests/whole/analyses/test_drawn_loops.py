"""Drawn loops against limits in closed form, the built-in loops that they repeat, and independently computed cases."""

import json
import pathlib
import tomllib
from fractions import Fraction

import numpy as np
import pytest
from meaning.judge import compiled as meant
from meaning.judge import judge_response
from meaning.reading import machine_of
from meaning.specs import toml
from support.drawn import ARM, PD, as_blocks

import wavesweep
from wavesweep.check.planning import plan
from wavesweep.engine.errors import SpecError, UsageError
from wavesweep.program.analyses.interval_jobs import Way, job_of
from wavesweep.program.spec import load
from wavesweep.program.sweep.running import in_memory

T = 1e-3


def compiled(text, *changes):
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return wavesweep.compile(tomllib.loads(text))


def ends(table):
    assert table.certified.all()
    return table[["low", "high"]].to_numpy().tolist()


@pytest.mark.parametrize(
    ("key", "value", "values", "unit"),
    [("arm.mass", 0.2, [0.1, 0.2, 0.4], "kg"), ("net.every", 20, [11, 20], "tick")],
)
def test_a_number_in_a_block_is_swept_like_one_with_a_name(key, value, values, unit):
    """Every column but the axis's own is the same to the last bit, and so are the answers if intervals along it are wanted."""
    block, _, name = key.partition(".")
    named, own = tomllib.loads(ARM), tomllib.loads(ARM)
    named["numbers"]["n"] = value
    named["block"][block][name] = "n"
    sweep = {"along": "c", "c": {"start": -1, "stop": 20}}
    for tables, axis in ((named, "n"), (own, f"block.{key}")):
        tables["sweep"] = {**sweep, axis: values}
    first, second = wavesweep.stability_region(named), wavesweep.stability_region(own)
    assert first.rename(columns={"n": f"block.{key}"}).equals(second)
    assert second.attrs["units"][f"block.{key}"] == unit
    if name == "mass":
        span = {"start": 0.01, "stop": 1.0}
        tables = [{**each, "sweep": {"along": axis, axis: span}} for each, axis in ((named, "n"), (own, f"block.{key}"))]
        first, second = (wavesweep.stability_region(each).drop(columns="along") for each in tables)
        assert first.equals(second)
        assert first.certified.all()


# Computed independently of this program, in 40-digit arithmetic: stable K_VE up to 20000 N/m by B_VE, the spectral radius of a
# frame at the spec's own wall, and [re, im] of the admittance and impedance.
REFERENCES = json.loads((pathlib.Path(__file__).parents[2] / "support" / "references.json").read_text(encoding="utf-8"))

# Hz where the response of the drawn loop is not known: a trapezoidal avatar at an odd multiple of half its rate.
UNKNOWN = {"random 15": {450.0}}


@pytest.mark.sample(12)
@pytest.mark.slow
@pytest.mark.parametrize("case", REFERENCES, ids=[case["name"] for case in REFERENCES])
def test_blocks_give_the_reference_cases(case):
    values = load(case["spec"]).values
    gives_the_reference(wavesweep.compile(as_blocks(values)), case, "K_VE", "B_VE")


CONTROLLERS = pathlib.Path(__file__).parents[3] / "sweeps" / "recipes" / "controllers"
DRAWN = {
    "dc": "ideal",
    "dc-slow": "dc-slow, no delay",
    "dc-lm": "power-domain local model",
    "pmw": "pmw passive: stable without end",
    "pmw-lm": "Fig. 6, filter bank as inferred",
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", DRAWN)
def test_the_drawn_controllers_are_reference_cases_and_the_built_in_ones(kind):
    case = next(case for case in REFERENCES if case["name"] == DRAWN[kind])
    text = (CONTROLLERS / f"{kind}.toml").read_text(encoding="utf-8")
    assert f"\n#     wavesweep zwidth sweeps/recipes/controllers/{kind}.toml\n" in text
    drawn, built = wavesweep.zwidth(tomllib.loads(text)), wavesweep.compile(load(case["spec"]))
    own = built.stable_intervals("K_VE", (0.0, 20000.0), B_VE=np.linspace(0, 15, 31))
    np.testing.assert_allclose(drawn[["B", "low", "high"]], own[["B_VE", "low", "high"]], rtol=1e-10)
    assert drawn.certified.all()
    gives_the_reference(wavesweep.compile(tomllib.loads(text)), case, "K", "B")


def gives_the_reference(loop, case, stiffness, damping):
    """All numbers of the case to 1e-10; the wall's numbers have these names."""
    for value, wanted in case["intervals"].items():
        found = loop.stable_intervals(stiffness, (0, 20000), **{damping: [float(value)]})
        np.testing.assert_allclose(ends(found), wanted, rtol=1e-10)
    power = 20 if case["spec"]["controller"]["kind"] == "dc" else 1  # a frame of the drawn one is one tick
    assert float(loop.spectral_radius()) ** power == pytest.approx(case["spectral_radius"], rel=1e-10)
    rows = loop.response(case["frequency_hz"])
    known = np.isfinite(rows.admittance_abs.to_numpy())
    assert set(rows.frequency_hz[~known]) <= UNKNOWN.get(case["name"], set())
    for name in ("admittance", "impedance"):
        seen = rows[f"{name}_re"].to_numpy() + 1j * rows[f"{name}_im"].to_numpy()
        np.testing.assert_allclose(seen[known], (np.array(case[name]) @ [1, 1j])[known], rtol=1e-10)


def test_a_number_that_is_one_scalar_gain_and_others_agree():
    """kd acts in every tick: in a wire or in a gain it is cut out; if a second place reads it, panels find the ends."""
    axis = "along = 'kd'\nkd = { start = 0, stop = 2000 }\n"
    gain = PD.replace("[wire]", '[block.g]\ntype = "gain"\nk = "3 - 2*kd"\n[wire]\n"g.u" = "m.v/2"')
    gain = gain.replace("kd*m.v", "1.5*m.v + g.y")
    twice = PD.replace("[wire]", '[block.h]\ntype = "gain"\n[wire]\n"h.u" = "kd*m.v"')
    jobs = [job_of(load(tomllib.loads(text + axis))) for text in (PD, gain, twice)]
    assert [job.asked.way for job in jobs] == [Way.CUT, Way.CUT, Way.DOMINANCE]
    tables = [in_memory(job) for job in jobs]
    for table in tables[1:]:
        np.testing.assert_allclose(table["low"], tables[0]["low"], rtol=1e-9)
        np.testing.assert_allclose(table["high"], tables[0]["high"], rtol=1e-9)


def test_drift_is_named_and_set_aside():
    """A mass whose position nothing reads, and waves without position feedback."""
    loop = compiled(PD, ("kp*m.x", "0.01*kp*m.v"))
    assert loop.spectral_radius() == pytest.approx(np.exp(-(3 + 1) * T / 0.2), rel=0.02)
    lines = "\n".join(plan(load(as_blocks(load({"controller": {"kind": "pmw"}}).values))))
    assert "drift set aside: m position" in lines
    assert "zwidth: stable intervals along K_VE in (0, 20000)" in lines


def test_a_loop_that_diverges_stops_and_says_so():
    facts = wavesweep.simulate(tomllib.loads(ARM.replace("value = 0.0", "value = 20.0")))[0].attrs["facts"]
    assert facts["ticks"]["simulated"] < 5000
    assert facts["ticks"]["stopped"] == "the hand's position exceeds 1000 m"
    assert facts["linear_loop"]["spectral_radius"] == pytest.approx(1.1517, abs=1e-4)
    turning = ARM.replace("value = 0.0", "value = 20.0").replace(
        'displacement = "arm.x"', 'displacement = "arm.x", turns = true'
    )
    facts = wavesweep.simulate(tomllib.loads(turning))[0].attrs["facts"]
    assert facts["ticks"]["stopped"] == "the hand's position exceeds 1000 rad"


def arm(read, damping=0.0, lp=None):
    """A mass whose velocity is taken from differences of what is read of its position."""
    filtered = {"lp": {"type": "butterworth", "order": 1, "cutoff_hz": 50.0}} if lp else {}
    return {
        "rates": {"tick_hz": 1000.0},
        "numbers": {"kp": 0.1} | ({"q": 2.0} if "q" in f"{read}{lp}" else {}),
        "block": {"arm": {"type": "mass", "mass": 0.4, "damping": damping}, "df": {"type": "difference"}, **filtered},
        "wire": {"arm.f": "push - kp*df.y", "df.u": read, **({"lp.u": lp} if lp else {})},
        "ports": {"hand": {"force": "push", "displacement": "arm.x"}},
    }


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_position_that_drifts_with_another_state_is_not_at_rest(factor):
    """A frame of one tick: the worst force is the force itself."""
    table = wavesweep.compile(arm(f"{factor}*arm.x", damping=1.0)).response([0.0, 1e-3, 1.0])
    assert np.isnan(table.admittance_abs[0])
    np.testing.assert_allclose(table.worst_gain[1:], table.admittance_abs[1:], rtol=1e-10)


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9])
def test_bounds_of_responses_know_how_well_algebraic_loops_are_conditioned(gap):
    a, b, k = 1 / 3, 3 * (1 - gap), 3 * gap
    damping = float(Fraction(k) * Fraction(a) / (1 - Fraction(a) * Fraction(b)))
    plant = {"type": "mass", "mass": 0.4, "damping": 1.0, "stiffness": 20.0}
    ports = {"hand": {"force": "push", "displacement": "arm.x"}}
    loops = [
        {
            "block": {"arm": plant, "g1": {"type": "gain", "k": a}, "g2": {"type": "gain", "k": b}},
            "wire": {"g1.u": "g2.y + arm.v", "g2.u": "g1.y", "arm.f": f"push - {k!r}*g1.y"},
        },
        {"block": {"arm": plant}, "wire": {"arm.f": f"push - {damping!r}*arm.v"}},
    ]
    found, exact = (wavesweep.compile({"rates": {"tick_hz": 1000.0}, "ports": ports, **loop}).response([1.2]) for loop in loops)
    for name, value in (("admittance", "admittance_abs"), ("worst_gain", "worst_gain")):
        error = abs(found[value][0] / exact[value][0] - 1)
        assert error <= found[f"{name}_error"][0] + exact[f"{name}_error"][0]
        assert found[f"{name}_error"][0] < 1e-12 / gap * 1e4


FREE = {"type": "mass", "mass": 1.0, "damping": 2.0}


@pytest.mark.parametrize(
    ("blocks", "reaction"),
    [
        ({"a": FREE}, "5*a.x"),
        ({"a": FREE | {"stiffness": 100.0}, "i": {"type": "integrator"}}, "100*i.y"),
    ],
)
def test_a_force_that_moves_with_a_drift_is_that_of_the_documents(blocks, reaction, tmp_path):
    """The march of a sine knows no drift."""
    wire = {f"{name}.{port}": text for name, port, text in (("a", "f", "p"), ("i", "u", "a.v")) if name in blocks}
    hand = {"force": "p", "displacement": "a.x", "reaction": reaction}
    text = toml({"rates": {"tick_hz": 1000}, "block": blocks, "wire": wire, "ports": {"hand": hand}})
    loop = meant(text, tmp_path)
    found = judge_response(machine_of(tomllib.loads(text)), loop, ("p", "hand displacement", "hand reaction"))
    assert found
    assert [one for one in found if not one.same] == []
    if "i" not in blocks:
        assert loop.response([0.0]).impedance_re[0] == pytest.approx(5.0, abs=1e-9)


@pytest.mark.parametrize(
    ("integration", "key", "value"), [("implicit", "K", -3000), ("trapezoidal", "K", -6000), ("explicit", "B", -3)]
)
def test_a_local_model_that_divides_by_nothing_is_refused_at_its_key(integration, key, value):
    model = {"type": "local_model", "b": 3.0, "K": 10.0, "B": 0.0, "integration": integration}
    wire = {"a.f": "-a.x - a.v + 0.1*z.out", "z.in": "a.v"}
    tables = {"rates": {"tick_hz": 1000}, "block": {"a": FREE, "z": model | {key: value}}, "wire": wire}
    with pytest.raises(SpecError, match=f"block.z.{key}: expected a number with which b"):
        load(tables)
    loop = wavesweep.compile(tables | {"numbers": {"k": 10.0}, "block": {"a": FREE, "z": model | {key: "k"}}})
    with pytest.raises(SpecError, match=f"block.z.{key}"):
        loop.spectral_radius(k=[10.0, float(value)])
    with pytest.raises(UsageError, match="a value without a loop"):
        loop.stable_intervals("k", (1.1 * value, 10.0))
    assert loop.stable_intervals("k", (0.9 * value, 10.0)).certified.all()


@pytest.mark.parametrize(
    ("block", "gain", "radii"),
    [
        ({"type": "gain"}, 0.3, 0.0),
        ({"type": "delay", "steps": 3}, 0.0, 0.0),
        ({"type": "delay", "steps": 3}, 0.001, 0.1),
        ({"type": "integrator"}, 10.0, 0.0),
        ({"type": "integrator"}, 9.9, 0.01),
    ],
)
def test_the_radius_of_a_loop_that_forgets_is_known(block, gain, radii):
    wire = {"p.u": "-K*p.y"}
    loop = wavesweep.compile({"rates": {"tick_hz": 10}, "numbers": {"K": gain}, "block": {"p": block}, "wire": wire})
    assert loop.spectral_radius() == pytest.approx(radii, rel=1e-9, abs=1e-12)
