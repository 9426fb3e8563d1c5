"""Controllers without waves: direct coupling at the fast rate and at the slow one, and a power-domain local model."""

from wavesweep.diagram.device import device
from wavesweep.diagram.drawing import Diagram, hand, rates


def dc(values) -> Diagram:
    """The paper's ideal: the wall is computed every tick, so the frame is one tick and F_s is the control force."""
    return _coupled(values, {"ratio": 1, "delay": 0})


def dc_slow(values) -> Diagram:
    """Direct coupling to the slow wall, which reads samples of the device and whose force is held."""
    return _coupled(values, rates(values))


def dc_lm(values) -> Diagram:
    """The slow wall's held force, and a fast spring and damper about the samples that this force was computed from."""
    stiffness, damping = values["local_model.K_LM"], values["local_model.B_LM"]
    about_samples = {
        "device.x": stiffness,
        "x_ref": -1 * stiffness,
        "device.v_hat": damping,
        "v_ref": -1 * damping,
    }
    return _coupled(values, rates(values), about_samples, {"x_ref": "x_tilde", "v_ref": "x_tilde_dot"})


def _coupled(values, timing, more_force=None, more_holds=None) -> Diagram:
    """hand -> device -> samplers -> wall -> hold -> device, with the terms that a fast controller adds to the held force."""
    facts = hand(values)
    return Diagram(
        fast=(device(values, facts["period"]),),
        slow=(),
        sums={"device.f": {"f_h": 1, "f_m": -1}, "f_m": {"held_F": 1} | (more_force or {})},
        samples={"x_tilde": "device.x", "x_tilde_dot": "device.v_hat"},
        holds={"held_F": "F_s"} | (more_holds or {}),
        wall=("x_tilde", "x_tilde_dot"),
        **timing,
        **facts,
    )
