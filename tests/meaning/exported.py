"""The exported C of a controller, compiled, and run on what the interpreter's device does."""

import ctypes
import subprocess
from pathlib import Path

import numpy as np

HOST = """
#include "controller.h"
void run(int ticks, const double *x, const double *v, double *force)
{
    static ws_state s;
    int tick;
    ws_init(&s);
    for (tick = 0; tick < ticks; tick++) {
        ws_inputs in;
        %s
        force[tick] = ws_fast_tick(&s, in).ws_device_f;
    }
}
"""


def forces(compiler: str, folder: Path, x: np.ndarray, v: np.ndarray) -> np.ndarray:
    """What the controller in `folder` exerts on a device with these positions and speeds."""
    header = (folder / "controller.h").read_text()
    reads = [f"in.ws_device_{port} = {port}[tick];" for port in ("x", "v") if f"ws_device_{port};" in header]
    host = folder / "host.c"
    host.write_text(HOST % " ".join(reads))
    library = folder / "host.so"
    sources = [str(folder / "controller.c"), str(host)]
    subprocess.run(
        [compiler, "-std=c99", "-O1", "-ffp-contract=off", "-shared", "-fPIC", *sources, "-o", str(library)], check=True
    )
    force = np.empty(len(x))
    pointer = ctypes.POINTER(ctypes.c_double)
    arrays = [np.ascontiguousarray(array).ctypes.data_as(pointer) for array in (x, v, force)]
    ctypes.CDLL(str(library)).run(len(x), *arrays)
    return force
