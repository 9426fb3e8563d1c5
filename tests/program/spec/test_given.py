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


def test_a_default_that_is_written_out_is_given():
    assert load(LOOP | {"environment": {"delay": 0}}).given == {"controller.kind", "environment.delay"}


def test_rates_and_band_edges_are_given_under_their_own_names():
    edges = dict.fromkeys(("passband_hz", "passband_db"), 1.0) | dict.fromkeys(("stopband_hz", "stopband_db"), 40.0)
    spec = load(LOOP | {"rates": {"slow_hz": 50}, "filters": {"lp1": edges}})
    assert spec.given == {"controller.kind", "rates.slow_hz", *(f"filters.lp1.{edge}" for edge in edges)}
    assert load(LOOP | {"rates": {"slow_hz": 50}}, ["rates.ratio=10"]).given == {"controller.kind", "rates.ratio"}


def test_changed_values_are_given_and_the_spec_itself_stays_as_it_was():
    spec = load(LOOP)
    assert spec.with_values({"K_VE": 100}).given == {"controller.kind", "environment.K_VE"}
    assert spec.given == {"controller.kind"}
