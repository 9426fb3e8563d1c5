"""Hold what commands say of many random specs: `python tests/words --seeds 200 --first 1000`, or `--of devices`."""

import argparse
import os
import sys
import tempfile
import traceback
from functools import partial
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from words.devices import hold_device
from words.encoders import hold_encoder
from words.hands import hold_hands
from words.law import OTHERS, hold_spec

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--each", type=int, default=1, help="of how many specs one goes through all commands")
    parser.add_argument("--of", choices=("loops", "devices", "encoders", "hands", "boxes"), default="loops")
    asked = parser.parse_args()
    held = {"devices": hold_device, "encoders": hold_encoder, "hands": hold_hands, "boxes": partial(hold_hands, box=True)}
    red = 0
    for seed in range(asked.first, asked.first + asked.seeds):
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                if asked.of in held:
                    held[asked.of](seed)
                else:
                    hold_spec(seed, () if seed % asked.each else OTHERS)
            except Exception:  # noqa: BLE001 (each is a fault, and the next spec is tried)
                red += 1
                last = traceback.format_exc().strip().splitlines()
                sys.stdout.write(f"seed {seed}: {last[-1][:700]}\n")
                sys.stdout.flush()
            os.chdir("/")
    sys.stdout.write(f"{asked.seeds} specs, {red} red\n")
    sys.exit(red > 0)
