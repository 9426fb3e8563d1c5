"""`python sweeps/paper/reproduce`, with the figures and statements that are quick."""

from functools import cache

import pytest

pytest.importorskip("wavesweep.passive", reason="the paper's program asks for passivity")
from reproduce import figures, open_choices, passive_bank
from reproduce.__main__ import main
from reproduce.specs import load_paper
from reproduce.statements.stability import STATEMENTS

pytestmark = pytest.mark.slow

STUDIES = {open_choices: "open_choices", passive_bank: "passive_bank"}


@pytest.fixture(scope="module")
def studies():
    """The two studies that no statement needs, of few designs, computed once for all runs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(passive_bank, "DESIGNS", passive_bank.SHOWN)
        few = ("sweep.B_VE=[1, 15]", "sweep.b=[10, 25]", "sweep.environment.delay=[0, 1]")
        patch.setattr(open_choices, "load_paper", lambda name: load_paper(name, few * (name == "open-choices")))
        yield {module: cache(getattr(module, name)) for module, name in STUDIES.items()}


@pytest.fixture(autouse=True)
def short(monkeypatch, tmp_path, studies):
    """One figure and the statements on it, in a new folder."""
    for module, once in studies.items():
        monkeypatch.setattr(module, STUDIES[module], once)
    monkeypatch.setattr(figures, "FIGURES", (figures.figure_4,))
    monkeypatch.setattr(figures, "STATEMENTS", STATEMENTS[:1])
    monkeypatch.chdir(tmp_path)


def test_figures_tables_and_verdicts_go_to_a_folder_of_their_own(tmp_path, capsys):
    main([])
    suffixes = (".csv", ".parquet", ".datapackage.json")
    names = ("fig4", "fig4-b25", "open-choices", "passive-bank", "statements")
    expected = {f"{name}{suffix}" for name in names for suffix in suffixes}
    found = {file.name for file in (tmp_path / "results/paper").iterdir()}
    assert found == expected | {"fig4.png", "open-choices.md", "passive-bank.png", "passive-bank.md", "statements.md"}
    last = capsys.readouterr().out.splitlines()[-1]
    assert last.startswith("1 statements: 0 reproduced, 1 reproduced only under an inferred value")


def test_somebody_elses_table_is_not_replaced(tmp_path, capsys):
    (tmp_path / "there").mkdir()
    (tmp_path / "there/fig4.csv").write_text("mine\n")
    with pytest.raises(SystemExit) as ended:
        main(["--out", "there"])
    assert ended.value.code == 2
    assert "overwrite" in capsys.readouterr().err
    assert (tmp_path / "there/fig4.csv").read_text() == "mine\n"
