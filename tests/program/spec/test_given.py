"""A spec remembers which keys were given, wherever they were given, and which have their defaults."""

from wavesweep.program.spec import load

LOOP = {"controller": {"kind": "pmw"}}


def test_keys_of_a_file_and_of_overrides_are_given(tmp_path):
    path = tmp_path / "wall.toml"
    path.write_text('controller.kind = "pmw"\n[environment]\nB_VE = 1.0\n[sweep]\nb = [1, 2]\n')
    assert load(path).given == {"controller.kind", "environment.B_VE"}
    added = {"controller.b", "environment.integration"}
    spec = load(path, ["b=40", "environment.integration=implicit", "sweep.Kp=[1]"])
    assert spec.given == load(path).given | added


def test_changed_values_are_given_and_the_spec_itself_stays_as_it_was():
    spec = load(LOOP)
    assert spec.with_values({"K_VE": 100}).given == {"controller.kind", "environment.K_VE"}
    assert spec.given == {"controller.kind"}
