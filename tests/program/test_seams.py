"""What capabilities offer: names and signatures of `program.seams`, and nothing that nobody asks for."""

import inspect
import re
from collections import Counter
from importlib import import_module
from pathlib import Path

import pytest

import wavesweep
from wavesweep.capabilities import CAPABILITIES
from wavesweep.program.seams import SEAMS, AsYouLike

OFFERED = [(each, name) for each in CAPABILITIES for name in each.offers]
TYPED = [pair for pair in OFFERED if pair[1] in SEAMS]
NONE = [pytest.param(None, "", marks=pytest.mark.skip(reason="every capability is taken away"))]


def shape_of(function):
    """The arguments that a function takes by place, and whether it takes any number of them."""
    arguments = [each for each in inspect.signature(function).parameters.values() if each.name != "self"]
    rest = any(each.kind is each.VAR_POSITIONAL for each in arguments)
    return [each for each in arguments if each.kind is each.POSITIONAL_OR_KEYWORD], rest


ASKED = re.compile(r'(?<!\.)\b(modules|asked|offered)\(\s*"(\w+)"')


def test_every_module_that_is_offered_is_asked_for():
    sources = [path.read_text(encoding="utf-8") for path in Path(wavesweep.__file__).parent.rglob("*.py")]
    named = {name for source in sources for _, name in ASKED.findall(source)}
    beside = set() if "late_ticks" in {each.name for each in CAPABILITIES} else {"rules"}  # which it alone asks for
    assert {name for _, name in OFFERED} <= named | beside


@pytest.mark.whole
def test_what_has_a_type_is_offered_by_several_and_the_rest_by_one():
    offers = Counter(name for _, name in OFFERED)
    assert {name for name, count in offers.items() if count > 1} == set(SEAMS)


@pytest.mark.parametrize(("capability", "name"), TYPED or NONE, ids=lambda each: getattr(each, "name", each))
def test_a_module_that_is_offered_has_the_names_and_arguments_of_its_type(capability, name):
    module = import_module(capability.name_of(name))
    hooks = [each for each in (*SEAMS[name].__annotations__, *vars(SEAMS[name])) if each[0] != "_"]
    public = [each for each in vars(module) if each[0] != "_"]
    if AsYouLike in SEAMS[name].__mro__:
        own = [each for each in public if getattr(vars(module)[each], "__module__", "") == module.__name__]
        assert set(own) <= set(hooks), "a function that nobody asks for"
    else:
        assert set(hooks) <= set(public)
    for hook, of_seam in vars(SEAMS[name]).items():
        offered = getattr(module, hook, None) if inspect.isfunction(of_seam) else None
        if inspect.isfunction(offered):
            wanted, _ = shape_of(of_seam)
            taken, rest = shape_of(offered)
            needed = [each for each in taken if each.default is each.empty]
            assert len(needed) <= len(wanted), hook
            assert rest or len(taken) >= len(wanted), hook
