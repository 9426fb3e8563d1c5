"""A filter as straight lines of C: the cascade of one-pole sections of the simulation, operation by operation."""

from collections.abc import Sequence

from wavesweep.analysis.simulation.cascade import Section
from wavesweep.export.text import factor


def states_of(sections: Sequence[Section]) -> int:
    """The number of doubles that a filter keeps: one for a real pole, two for a pair."""
    return sum(2 if section.p.imag else 1 for section in sections)


def filter_functions(name: str, what: str, sections: Sequence[Section], peeked: bool) -> str:
    """Return the functions `<name>_output`, if it is needed (`peeked`), and `<name>_advance`; without sections they pass."""
    parts = [f"\n/* {what} */"]
    if peeked:
        parts.append(_function(f"{name}_output", "const ws_state *s", _lines(sections, f"s->{name}", store=False)))
    parts.append(_function(f"{name}_advance", "ws_state *s", _lines(sections, f"s->{name}", store=True)))
    return "\n".join(parts) + "\n"


def _function(name, state, lines):
    body = "".join(f"    {line}\n" for line in lines or ["(void)s;"])
    return f"static double {name}({state}, double u)\n{{\n{body}    return u;\n}}"


def _lines(sections, array, store):
    """Return the statements of all sections, in their order; the old state is read before it is replaced."""
    lines, place = ["double y, next;"] if store and sections else [], 0
    for p, g, r, d in sections:
        a, b = f"{array}[{place}]", f"{array}[{place + 1}]"
        if p.imag:
            output = f"{factor(r.real)} * {a} - {factor(r.imag)} * {b} + {factor(d)} * u"
            after = f"{factor(p.real)} * {a} - {factor(p.imag)} * {b} + {factor(g)} * u"
            second = [f"{b} = {factor(p.real)} * {b} + {factor(p.imag)} * {a};"]
        else:
            output, after, second = f"{factor(r)} * {a} + {factor(d)} * u", f"{factor(p)} * {a} + {factor(g)} * u", []
        lines += [f"y = {output};", f"next = {after};", *second, f"{a} = next;", "u = y;"] if store else [f"u = {output};"]
        place += 2 if p.imag else 1
    return lines
