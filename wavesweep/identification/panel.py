"""What a page of `explore` shows of the points of [measured]."""

from wavesweep.identification.measured import read_points
from wavesweep.program.columns import complex_columns
from wavesweep.program.spec import Spec


def data(spec: Spec) -> dict[str, dict[str, object]]:
    """What [measured] names: the walls as (damping, stiffness, whether stable, None of a limit),
    and the response; if any."""
    walls, response = read_points(spec)
    marked: dict[str, object] = {}
    if walls is not None:
        if walls.stable is None:
            kinds = [None] * len(walls.K_VE)
        else:
            kinds = walls.stable.tolist()
        points = list(zip(walls.B_VE.tolist(), walls.K_VE.tolist(), kinds, strict=True))
        marked["walls"] = {"stiffness": spec.wall[0], "damping": spec.wall[1], "points": points}
    if response is not None:
        columns = {"frequency_hz": response.frequency_hz} | complex_columns(
            "admittance", response.admittance
        )
        marked["response"] = {name: column.tolist() for name, column in columns.items()}
    return {"measured": marked}
