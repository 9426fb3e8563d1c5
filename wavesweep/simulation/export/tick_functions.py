"""The program of a tick as a function in C."""

from collections.abc import Iterable, Iterator, Sequence

from wavesweep.simulation.export.text import factor
from wavesweep.simulation.tick_sums import Line, Program


def tick_function(
    number: int, program: Program, names: Sequence[str], between: Sequence[str] = ()
) -> str:
    """Return a program as a function: a sum for each line, which begins with 0 and adds product
    after product, within limits.

    names: of the places in C. between: lines before those of `second`, in place of a wall.
    """
    lines = list(_summed(program, program.first, names))
    if program.wall:
        lines.append(f"    meet(s, {factor(program.wall.yields)}, {factor(program.wall.slows)});")
    lines += [*between, *_summed(program, program.second, names)]
    writes = _kept(program, names)
    head = ["    double *const z = s->z;"]
    for source, first, last in program.moves:
        if last - first > 1:
            writes += [f"    for (i = {last - 1}; i > {first}; i--)", "        z[i] = z[i - 1];"]
            head = ["    double *const z = s->z;", "    int i;"]
        writes.append(f"    z[{first}] = z[{names[source]}];")
    if writes:
        lines += ["    { /* what is kept */", *(f"    {line}" for line in writes), "    }"]
    body = "\n".join([*head, *lines] if lines else ["    (void)s;"])
    return f"static void tick_{number}(ws_state *s)\n{{\n{body}\n}}\n"


def _summed(program: Program, lines: Iterable[Line], names: Sequence[str]) -> Iterator[str]:
    """Yield the lines in C that compute sums, each within its limits."""
    for target, terms in lines:
        place = f"z[{names[target]}]"
        yield f"    {place} = {sum_in_c(terms, names)};"
        if target in program.limits:
            low, high = map(factor, program.limits[target])
            yield f"    {place} = {place} < {low} ? {low} : {place} > {high} ? {high} : {place};"


def _kept(program: Program, names: Sequence[str]) -> list[str]:
    """The lines of a program that compute all that is kept for the next tick, and then write it."""
    stops = {line: places for line, *places in program.stops}
    computed = []
    written = []
    for index, (target, terms) in enumerate(program.keeps):
        total = sum_in_c(terms, names)
        if index in stops:
            free, limited, driven = (f"z[{names[place]}]" for place in stops[index])
            up = f"({free} > {limited} && {driven} > 0.0)"
            down = f"({free} < {limited} && {driven} < 0.0)"
            total = f"{up} || {down} ? z[{names[target]}] : {total}"
        computed.append(f"    const double kept_{index} = {total};")
        written.append(f"    z[{names[target]}] = kept_{index};")
    return computed + written


def sum_in_c(terms: Iterable[tuple[float, int]], names: Sequence[str]) -> str:
    """Return a sum of places; names: of these."""
    products = [product_in_c(gain, f"z[{names[source]}]") for gain, source in terms]
    return "".join(["0.0", *products])


def product_in_c(value: float, name: str) -> str:
    """Return a product to add; 1 and -1 change no bit of the number."""
    if value in (1.0, -1.0):
        return f" + {name}" if value > 0 else f" - {name}"
    return f" + {factor(value)} * {name}"
