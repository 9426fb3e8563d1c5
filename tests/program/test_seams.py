"""What capabilities offer: names and signatures of `program.seams`, and nothing that nobody asks for."""

import inspect
from importlib import import_module
from types import FunctionType, ModuleType

import pytest

from wavesweep.capabilities import CAPABILITIES
from wavesweep.engine.errors import UsageError
from wavesweep.program.seams import SEAMS, refuse_other_hooks, refuse_other_seams

OFFERED = [(each, name) for each in CAPABILITIES for name in each.offers]


def shape_of(function):
    """The arguments that a function takes by place, and whether it takes any number of them."""
    arguments = [each for each in inspect.signature(function).parameters.values() if each.name != "self"]
    rest = any(each.kind is each.VAR_POSITIONAL for each in arguments)
    return [each for each in arguments if each.kind is each.POSITIONAL_OR_KEYWORD], rest


@pytest.mark.parametrize(("capability", "name"), OFFERED, ids=lambda each: getattr(each, "name", each))
def test_a_module_that_is_offered_has_the_names_and_arguments_of_its_type(capability, name):
    module = import_module(capability.name_of(name))
    refuse_other_hooks(capability.name, name, module)
    for hook, of_seam in vars(SEAMS[name]).items():
        offered = getattr(module, hook, None) if inspect.isfunction(of_seam) else None
        if inspect.isfunction(offered):
            wanted, _ = shape_of(of_seam)
            taken, rest = shape_of(offered)
            needed = [each for each in taken if each.default is each.empty]
            assert len(needed) <= len(wanted), hook
            assert rest or len(taken) >= len(wanted), hook


def module_of(name, *names):
    module = ModuleType(name)
    for each in names:
        setattr(module, each, FunctionType((lambda: None).__code__, {"__name__": name}, each))
    return module


def test_a_misspelt_hook_is_an_error_that_names_the_nearest():
    with pytest.raises(UsageError, match=r"capability decays: expected some of .* in decays.on_check, found line; .* lines\?"):
        refuse_other_hooks("decays", "on_check", module_of("decays.on_check", "line", "facts"))
    with pytest.raises(UsageError, match=r"expected further, verdict_lines in decays.verdict, found no further, but furthr"):
        refuse_other_hooks("decays", "verdict", module_of("decays.verdict", "furthr", "verdict_lines"))
    refuse_other_hooks("decays", "on_check", module_of("decays.on_check", "lines", "_line"))


def test_a_misspelt_module_is_an_error_that_names_the_nearest():
    with pytest.raises(UsageError, match=r"capability decays: .* as offers, found on_chek; did you mean on_check\?"):
        refuse_other_seams({"decays": ("keys", "on_chek")})
