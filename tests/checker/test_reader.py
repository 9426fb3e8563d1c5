"""What the checker reads of a spec, against what the package reads of it, which shares nothing with it."""

import tomllib

import pytest
from meaning.judge import compiled, judge_radius
from meaning.machine import radius
from meaning.reading import drift_of, machine_of
from meaning.specs import linkage, spec_text, toml

TOGETHER = 3  # specs of one test


def differing(texts, folder) -> list[str]:
    """The specs whose loops have other modes."""
    found = []
    for text in texts:
        tables = tomllib.loads(text)
        frame = machine_of(tables).monodromy()
        judged = judge_radius(tables, radius(frame, drift_of(tables, frame)), compiled(text, folder))
        found += [] if judged.same else [f"{judged.mine} and {judged.theirs} of {text}"]
    return found


@pytest.mark.parametrize("first", range(0, 40 * TOGETHER, TOGETHER))
def test_a_loop_has_the_radius_of_the_package(first, tmp_path):
    texts = [spec_text(number, quick=True) for number in range(first, first + TOGETHER)]
    assert differing(texts, tmp_path) == []


@pytest.mark.asks("axes")
@pytest.mark.parametrize("kind", ["five-bar", "pantograph", "delta"])
def test_a_device_of_several_axes_has_the_radius_of_the_package(kind, tmp_path):
    assert differing([toml(linkage(7, kind))], tmp_path) == []
