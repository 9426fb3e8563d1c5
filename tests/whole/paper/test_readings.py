"""The table of choices: around the specs' own values, complete, and answered the same in a batch as alone."""

import pytest

from reproduce.readings import DIRECT, PMW, PMW_LM
from reproduce.specs import load_paper
from wavesweep.haptics.controller_page import keys_of_page
from wavesweep.haptics.controllers import WALL

PAPERS = {  # what the paper gives for its statements: a local model with a stiffness only, a device without delay
    *(
        "rates.fast_hz",
        "rates.ratio",
        "device.mass",
        "device.damping",
        "device.delay",
        "device.dead_time",
        "controller.kind",
        "controller.b",
        "controller.Kp",
    ),
    *("local_model.K_LM", "local_model.B_LM", "operator.mass", "operator.damping", "operator.stiffness"),
    *WALL,
}


@pytest.mark.parametrize(("name", "tried"), [("fig6", PMW_LM), ("pmw", PMW), ("dc", DIRECT)], ids=["PMW+LM", "PMW", "DC"])
def test_every_key_that_the_paper_leaves_open_and_the_loop_reads_has_choices(name, tried):
    varied = {path for reading in tried for path in reading.changes}
    assert varied == keys_of_page(load_paper(name).values) - PAPERS
